// Matrix products of rounded operands on emulated fragments, for every device: gemm_matrix.clh.
#include "gemm_matrix.clh"

kernel TEAMS_OF_LANES __attribute__((reqd_work_group_size(GROUP, 1, 1))) void gemm_matrix_gpu(GEMM_MATRIX_PARAMETERS) {
  local float4 work[WORK];
  gemm_matrix(work, GEMM_MATRIX_ARGUMENTS);
}
