// All use of MPI is in this module, which runtime/system/ranks.cpp loads if the process is one of several. Each
// function returns MPI's status, 0 on success.
#include <mpi.h>

#include <cstddef>

extern "C" {

__attribute__((visibility("default"))) int vsplat_mpi_start(int* rank, int* count) {
  int there = 0;
  MPI_Initialized(&there);
  if (!there) {
    int given = 0;
    if (const int error = MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &given)) return error;
  }
  int given = 0;
  MPI_Query_thread(&given);
  if (given < MPI_THREAD_SERIALIZED) return MPI_ERR_OTHER;  // the embedding program initialised MPI with a lower level
  if (const int error = MPI_Comm_rank(MPI_COMM_WORLD, rank)) return error;
  return MPI_Comm_size(MPI_COMM_WORLD, count);
}

__attribute__((visibility("default"))) int vsplat_mpi_send(int to, const void* data, int size) {
  return MPI_Send(data, size, MPI_BYTE, to, 0, MPI_COMM_WORLD);
}

__attribute__((visibility("default"))) int vsplat_mpi_receive(int from, void* data, int size) {
  return MPI_Recv(data, size, MPI_BYTE, from, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
}

__attribute__((visibility("default"))) int vsplat_mpi_broadcast(void* data, int size) {
  return MPI_Bcast(data, size, MPI_BYTE, 0, MPI_COMM_WORLD);
}

__attribute__((visibility("default"))) void vsplat_mpi_abort(int code) { MPI_Abort(MPI_COMM_WORLD, code); }

__attribute__((visibility("default"))) void vsplat_mpi_end() {
  int gone = 0;
  MPI_Finalized(&gone);
  if (!gone) MPI_Finalize();
}
}
