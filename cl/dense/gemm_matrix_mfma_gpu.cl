// The products of gemm_matrix.clh by the matrix units of AMD's CDNA2.
// targets: amd:gfx90a
#define MATRIX_MFMA
#include "gemm_matrix.clh"

kernel TEAMS_OF_LANES __attribute__((reqd_work_group_size(GROUP, 1, 1))) void gemm_matrix_mfma_gpu(
    GEMM_MATRIX_PARAMETERS) {
  local float4 work[WORK];
  gemm_matrix(work, GEMM_MATRIX_ARGUMENTS);
}
