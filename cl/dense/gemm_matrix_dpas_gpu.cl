// The products of gemm_matrix.clh by Intel's matrix units.
// targets: intel:dg2, intel:pvc
#include "many_registers.clh"
#ifndef MATRIX_DPAS
#if SUB_GROUP == 16
#define MATRIX_DPAS 16
#else
#define MATRIX_DPAS 8
#endif
#endif
#include "gemm_matrix.clh"

kernel TEAMS_OF_LANES __attribute__((reqd_work_group_size(GROUP, 1, 1))) void gemm_matrix_dpas_gpu(
    GEMM_MATRIX_PARAMETERS) {
  local float4 work[WORK];
  gemm_matrix(work, GEMM_MATRIX_ARGUMENTS);
}
