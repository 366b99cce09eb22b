// The products of gemm_matrix.clh by the matrix units of AMD's RDNA3.
// targets: amd:gfx1100
#define MATRIX_WMMA
#include "gemm_matrix.clh"

kernel TEAMS_OF_LANES __attribute__((reqd_work_group_size(GROUP, 1, 1))) void gemm_matrix_wmma_gpu(
    GEMM_MATRIX_PARAMETERS) {
  local float4 work[WORK];
  gemm_matrix(work, GEMM_MATRIX_ARGUMENTS);
}
