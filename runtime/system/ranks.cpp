#include "runtime/system/ranks.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "runtime/fail.h"
#include "runtime/library_programs.h"
#include "runtime/system/environment.h"
#include "runtime/system/environment_check.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

constexpr std::size_t kLongest = std::size_t{1} << 30;  // bytes of a piece: MPI counts in int

// Checks the variables that common launchers set, since MPI itself is not loaded yet.
bool is_one_of_several() {
  check_environment();
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS"}) {
    const std::string count = environment(name);
    if (!count.empty()) return std::atoi(count.c_str()) > 1;
  }
  return false;
}

template <class F>
F* function(void* module, const char* name) {
  if (void* found = sys::symbol(module, name)) return reinterpret_cast<F*>(found);
  fail(Status::internal, "vsplat-mpi.so has no {}: it is not of this version", name);
}

void hold(int code, const char* what) {
  if (code != 0) fail(Status::internal, "MPI: {} ended with {}", what, code);
}

}  // namespace

Ranks& Ranks::world() {
  static Ranks world;
  return world;
}

Ranks::Ranks() {
  if (!is_one_of_several()) return;
  const std::string path = library_program("vsplat-mpi.so");
  // Symbols are shared, since MPI's own modules need them.
  std::string why;
  module_ = sys::load_library(path, sys::Symbols::shared, why);
  if (!module_)
    fail(Status::usage,
         "this process is one of several that mpirun started, but the module for MPI is not there ({}), so each "
         "process would do all of the work. Build with -DVSPLAT_MPI=ON, or start one process",
         why.empty() ? path : why);
  hold(function<int(int*, int*)>(module_, "vsplat_mpi_start")(&rank_, &count_), "MPI_Init_thread");
  // A process that ends without this counts as crashed.
  static void (*end)() = nullptr;
  end = function<void()>(module_, "vsplat_mpi_end");
  std::atexit([] { end(); });
  if (count_ == 1)
    fail(Status::usage,
         "this process is one of several, but MPI ({}) sees only one, so each process would do all of the work: start "
         "them with the MPI that the module was built with (srun starts Open MPI by PMIx), or start one process",
         path);
}

void Ranks::send_piece(int to, const void* data, std::size_t size) {
  const auto* from = static_cast<const unsigned char*>(data);
  auto* send = function<int(int, const void*, int)>(module_, "vsplat_mpi_send");
  for (std::size_t at = 0; at < size; at += kLongest)
    hold(send(to, from + at, static_cast<int>(std::min(kLongest, size - at))), "MPI_Send");
}

void Ranks::receive_piece(int from, void* data, std::size_t size) {
  auto* to = static_cast<unsigned char*>(data);
  auto* receive = function<int(int, void*, int)>(module_, "vsplat_mpi_receive");
  for (std::size_t at = 0; at < size; at += kLongest)
    hold(receive(from, to + at, static_cast<int>(std::min(kLongest, size - at))), "MPI_Recv");
}

void Ranks::send(int to, const Bytes& bytes) {
  const std::uint64_t size = bytes.size();
  send_piece(to, &size, sizeof size);
  send_piece(to, bytes.data(), bytes.size());
}

Ranks::Bytes Ranks::receive(int from) {
  std::uint64_t size = 0;
  receive_piece(from, &size, sizeof size);
  Bytes out(size);
  receive_piece(from, out.data(), out.size());
  return out;
}

void Ranks::broadcast(Bytes& bytes) {
  if (count_ == 1) return;
  auto* broadcast = function<int(void*, int)>(module_, "vsplat_mpi_broadcast");
  std::uint64_t size = bytes.size();
  hold(broadcast(&size, sizeof size), "MPI_Bcast");
  bytes.resize(size);
  for (std::size_t at = 0; at < size; at += kLongest)
    hold(broadcast(bytes.data() + at, static_cast<int>(std::min(kLongest, size - at))), "MPI_Bcast");
}

void Ranks::abort(int code) {
  if (count_ > 1) function<void(int)>(module_, "vsplat_mpi_abort")(code);
}

std::size_t MessageIn::size_of(std::size_t element) {
  const auto count = take<std::uint64_t>();
  if (count > (bytes_.size() - at_) / element)
    fail(Status::internal, "a message of {} bytes holds {} values of {} bytes", bytes_.size(), count, element);
  return count;
}

void MessageIn::raw(void* out, std::size_t size) {
  if (size > bytes_.size() - at_)
    fail(Status::internal, "a message of {} bytes ends before {} more", bytes_.size(), size);
  std::memcpy(out, bytes_.data() + at_, size);
  at_ += size;
}

}  // namespace vsplat
