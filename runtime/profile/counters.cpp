#include "runtime/profile/counters.h"

#include "runtime/arena.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr long kRows = 64;  // two flavours of four kernels, in one or two stages each

}  // namespace

Tensor Counters::numbers(const cl::Context& context, const cl::CommandQueue& queue) {
  used_ = true;
  if (numbers_) return numbers_;
  const Shape shape{kRows, 2};
  const std::size_t bytes = sizeof(cl_uint) * 2 * kRows;
  auto buffer = std::make_unique<cl::Buffer>(context, CL_MEM_READ_WRITE, bytes);
  queue.enqueueFillBuffer(*buffer, cl_uint{0}, 0, bytes);
  numbers_ = Tensor(std::make_shared<Block>(std::move(buffer), bytes), shape, Type::u32);
  return numbers_;
}

long Counters::number_of(const std::string& stage, const std::string& name, double flops_per_count) {
  const auto [at, fresh] = places_.emplace(std::make_pair(stage, name), static_cast<long>(rows_.size()));
  if (fresh) rows_.push_back({flops_per_count, 0});
  if (at->second >= kRows) fail(Status::internal, "more than {} rows of a profile count", kRows);
  return at->second;
}

std::vector<Counters::Count> Counters::take(const cl::CommandQueue& queue) {
  if (!used_) return {};
  used_ = false;
  std::vector<cl_uint> halves(2 * kRows);
  queue.enqueueReadBuffer(*numbers_.block()->buffer(), CL_TRUE, 0, sizeof(cl_uint) * halves.size(), halves.data());
  std::vector<Count> out;
  for (const auto& [row, place] : places_) {
    const auto i = static_cast<std::size_t>(place);
    const std::uint64_t now = halves[2 * i] | std::uint64_t{halves[2 * i + 1]} << 32;
    const std::uint64_t count = now - rows_[i].taken;
    rows_[i].taken = now;
    if (count > 0) out.push_back({row.first, row.second, count, static_cast<double>(count) * rows_[i].flops_per_count});
  }
  return out;
}

}  // namespace vsplat
