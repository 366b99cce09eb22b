// A step's gradients in shards: computed on several devices, gathered, and summed in order.
#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <sstream>

#include "model/train/trainer.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/share_out.h"
#include "runtime/tuning/held_tuning.h"

namespace vsplat {
namespace {

// Key in the checkpoint: the kind of each shard's device, one a line. Stored only if there are several kinds.
constexpr const char* kKinds = "part_devices";

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

}  // namespace

void Trainer::PartSums::add(const PartSums& next) {
  mse += next.mse;
  mse_coarse += next.mse_coarse;
  report.loss += next.report.loss;
  report.selected += next.report.selected;
  report.most_selected = std::max(report.most_selected, next.report.most_selected);
  report.intersections = std::max(report.intersections, next.report.intersections);
}

std::string Trainer::kind() const {
  const DeviceInfo& device = ctx_.device();
  const std::string table = ctx_.tuning().hash();
  const std::string off = switched_off_of(ctx_);
  return fmt::format("{} ({} {}), {} kernels{}{}", device.name, device.platform_name, device.driver,
                     name_of(ctx_.flavour()), table.empty() ? "" : ", tuned by " + table,
                     off.empty() ? "" : ", without " + off);
}

std::vector<float> Trainer::read_moved(Tensor LearntTensor::*what) const {
  std::vector<float> out;
  for (const LearntRun& run : weights_.runs()) {
    if (run.kind == none) continue;
    for (const std::string& name : run.names) {
      const std::vector<float> values = ctx_.read<float>(weights_.at(name).*what);
      out.insert(out.end(), values.begin(), values.end());
    }
  }
  return out;
}

void Trainer::write_moved(Tensor LearntTensor::*what, const std::vector<float>& values) const {
  std::size_t at = 0;
  for (const LearntRun& run : weights_.runs()) {
    if (run.kind == none) continue;
    for (const std::string& name : run.names) {
      const Tensor& tensor = weights_.at(name).*what;
      ctx_.write(tensor, values.data() + at);
      at += static_cast<std::size_t>(tensor.count());
    }
  }
}

std::pair<std::size_t, std::size_t> Trainer::parts_of(int rank) const {
  const auto parts = static_cast<std::size_t>(config_.parts),
             all = static_cast<std::size_t>(ranks_ ? ranks_->count() : 1);
  const auto r = static_cast<std::size_t>(rank);
  return {r * parts / all, (r + 1) * parts / all};
}

std::size_t Trainer::first_object(std::size_t part) const {
  return part * static_cast<std::size_t>(config_.batch * config_.accumulate) / static_cast<std::size_t>(config_.parts);
}

std::pair<std::size_t, std::size_t> Trainer::own_objects() const {
  const auto [first, last] = parts_of(ranks_ ? ranks_->rank() : 0);
  return {first_object(first), first_object(last)};
}

// Devices of one kind take shards as they become free (empty result). With mixed kinds, each shard goes to the least
// loaded device of the kind that computed it before; if no device of that kind is left, all shards are assigned
// dynamically again.
std::vector<std::size_t> Trainer::owners(const std::vector<Trainer*>& workers) const {
  const auto known = state_.find(kKinds);
  if (known == state_.end()) return {};
  const std::vector<std::string> kinds = lines(known->second);
  if (kinds.size() != static_cast<std::size_t>(config_.parts)) return {};
  const auto [first, last] = parts_of(ranks_ ? ranks_->rank() : 0);
  std::vector<std::size_t> out, load(workers.size());
  for (std::size_t part = first; part < last; ++part) {
    std::optional<std::size_t> owner;
    for (std::size_t w = 0; w < workers.size(); ++w)
      if (workers[w]->kind() == kinds[part] && (!owner || load[w] < load[*owner])) owner = w;
    if (!owner) return {};
    ++load[*owner];
    out.push_back(*owner);
  }
  return out;
}

// Stored in the checkpoint if the kinds differ.
void Trainer::keep_kinds(const std::vector<std::string>& kinds) {
  std::string text;
  bool several = false;
  for (const std::string& each : kinds) {
    text += each + "\n";
    several = several || each != kinds[0];
  }
  const auto known = state_.find(kKinds);
  if (known != state_.end() && known->second != text)
    warn(
        "the training's parts were on devices of other kinds before: its results are equal up to rounding, not to the "
        "bit");
  if (several)
    state_[kKinds] = text;
  else
    state_.erase(kKinds);
}

void Trainer::compute_parts(const std::vector<StepItem>& items, const std::function<void(Part)>& done) {
  std::vector<Trainer*> workers;
  if (computes_) workers.push_back(this);
  for (const std::unique_ptr<Trainer>& helper : helpers_)
    if (helper->computes_) workers.push_back(helper.get());
  const auto [first, last] = parts_of(ranks_ ? ranks_->rank() : 0);
  std::vector<std::optional<Part>> made(last - first);
  ShareOut shared;
  shared.items = made.size();
  shared.workers = workers.size();
  shared.ahead = made.size();
  shared.owner = owners(workers);
  shared.work = [&](std::size_t w, std::size_t i) {
    Trainer& worker = *workers[w];
    if (worker.step_ != step_) {
      worker.write_moved(&LearntTensor::value, moved_);
      worker.step_ = step_;
    }
    try {
      const PartSums sums = worker.gradients(items, first_object(first + i), first_object(first + i + 1));
      made[i] = Part{sums, worker.read_moved(&LearntTensor::gradient), worker.kind()};
    } catch (const Error& e) {
      if (e.status() == Status::cancelled)  // a stop request reached one worker: cancels the others
        for (Trainer* other : workers) other->ctx_.cancel();
      throw;
    }
  };
  shared.done = [&](std::size_t i) {
    done(std::move(*made[i]));
    made[i].reset();
  };
  shared.lost = [&](std::size_t w, std::size_t, const Error& error) {
    workers[w]->computes_ = false;
    warn("{} computes no more parts of a step, the others go on: {}", workers[w]->kind(), error.what());
  };
  try {
    share_out(shared);
  } catch (const Error&) {
    for (const std::unique_ptr<Trainer>& helper : helpers_) helper->ctx_.go_on();
    throw;
  }
}

Trainer::PartSums Trainer::gradients_in_parts(const std::vector<StepItem>& items) {
  std::optional<Part> total;
  std::vector<std::string> kinds;
  const auto add = [&](Part part) {
    kinds.push_back(part.kind);
    if (!total) {
      total = std::move(part);
      return;
    }
    total->sums.add(part.sums);
    for (std::size_t i = 0; i < total->gradients.size(); ++i) total->gradients[i] += part.gradients[i];
  };
  std::exception_ptr failed;
  try {
    compute_parts(items, add);
  } catch (...) {
    failed = std::current_exception();  // first receives what the other ranks send
  }
  for (int rank = 1; ranks_ && rank < ranks_->count(); ++rank) {
    const auto [first, last] = parts_of(rank);
    for (std::size_t part = first; part < last; ++part) {
      MessageIn message(ranks_->receive(rank));
      if (const auto status = message.take<Status>(); status != Status::ok) {
        if (!failed)
          failed = std::make_exception_ptr(Error(status, fmt::format("rank {}: {}", rank, message.take_text())));
        break;
      }
      Part received;
      received.sums = message.take<PartSums>();
      received.kind = message.take_text();
      received.gradients = message.take_floats();
      if (!failed) add(std::move(received));
    }
  }
  if (failed) std::rethrow_exception(failed);
  keep_kinds(kinds);
  write_moved(&LearntTensor::gradient, total->gradients);
  return total->sums;
}

void Trainer::help(const std::vector<StepItem>& items) {
  try {
    compute_parts(items, [&](Part part) {
      MessageOut out;
      ranks_->send(0, out.add(Status::ok).add(part.sums).add(part.kind).add(part.gradients).bytes());
    });
  } catch (const Error& e) {
    MessageOut out;
    ranks_->send(0, out.add(e.status()).add(std::string(e.what())).bytes());
  }
}

std::string Trainer::kinds() const {
  const auto known = state_.find(kKinds);
  return known == state_.end() ? "" : known->second;
}

void Trainer::take_moved(std::vector<float> values, const std::string& kinds) {
  if (kinds.empty())
    state_.erase(kKinds);
  else
    state_[kKinds] = kinds;
  write_moved(&LearntTensor::value, values);
  moved_ = std::move(values);
  ++step_;
}

}  // namespace vsplat
