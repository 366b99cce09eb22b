// A step's gradients in parts: on several devices, gathered and summed in the order of parts.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <sstream>

#include "model/train/trainer.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/share_out.h"

namespace vsplat {
namespace {

// In the checkpoint: the kind of each part's device, one a line; only where they are of several kinds.
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
  return fmt::format("{} ({} {}), {} kernels", device.name, device.platform_name, device.driver,
                     name_of(ctx_.flavour()));
}

std::vector<float> Trainer::read_moved(Tensor LearntTensor::*what) const {
  std::vector<float> out;
  for (const LearntRun& run : weights_.runs()) {
    if (run.kind == nobody) continue;
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
    if (run.kind == nobody) continue;
    for (const std::string& name : run.names) {
      const Tensor& tensor = weights_.at(name).*what;
      ctx_.write(tensor, values.data() + at);
      at += static_cast<std::size_t>(tensor.count());
    }
  }
}

// Of devices of one kind whichever is free takes a part, and none is anyone's. Of several kinds each part is one's of
// the kind that had it before, the one with the fewest; where no such is there, it is shared out anew.
std::vector<std::size_t> Trainer::owners(const std::vector<Trainer*>& workers) const {
  const auto known = state_.find(kKinds);
  if (known == state_.end()) return {};
  const std::vector<std::string> kinds = lines(known->second);
  std::vector<std::size_t> out, load(workers.size());
  for (const std::string& wanted : kinds) {
    std::optional<std::size_t> owner;
    for (std::size_t w = 0; w < workers.size(); ++w)
      if (workers[w]->kind() == wanted && (!owner || load[w] < load[*owner])) owner = w;
    if (!owner) return {};
    ++load[*owner];
    out.push_back(*owner);
  }
  return out.size() == static_cast<std::size_t>(config_.parts) ? out : std::vector<std::size_t>();
}

void Trainer::keep_kinds(const std::vector<Trainer*>& workers, const std::vector<std::size_t>& by) {
  std::string text;
  bool several = false;
  for (const std::size_t w : by) text += workers[w]->kind() + "\n";
  for (const Trainer* worker : workers) several = several || worker->kind() != workers[0]->kind();
  const auto known = state_.find(kKinds);
  if (known != state_.end() && known->second != text)
    warn(
        "the training's parts were on devices of other kinds before: its results are equal within what floating "
        "point leaves, not to the bit");
  if (several)
    state_[kKinds] = text;
  else
    state_.erase(kKinds);
}

Trainer::PartSums Trainer::gradients_in_parts(const std::vector<StepItem>& items) {
  std::vector<Trainer*> workers;
  if (computes_) workers.push_back(this);
  for (const std::unique_ptr<Trainer>& helper : helpers_)
    if (helper->computes_) workers.push_back(helper.get());
  const auto parts = static_cast<std::size_t>(config_.parts);
  struct Part {
    PartSums sums;
    std::vector<float> gradients;
  };
  std::vector<std::optional<Part>> made(parts);
  std::vector<std::size_t> by(parts);  // whom
  std::optional<Part> total;
  ShareOut shared;
  shared.items = parts;
  shared.workers = workers.size();
  shared.ahead = parts;
  shared.owner = owners(workers);
  shared.work = [&](std::size_t w, std::size_t part) {
    Trainer& worker = *workers[w];
    if (worker.step_ != step_) {
      worker.write_moved(&LearntTensor::value, moved_);
      worker.step_ = step_;
    }
    try {
      const PartSums sums = worker.gradients(items, part * items.size() / parts, (part + 1) * items.size() / parts);
      made[part] = Part{sums, worker.read_moved(&LearntTensor::gradient)};
    } catch (const Error& e) {
      if (e.status() == Status::cancelled)  // whoever was told to stop: none is to hold up the others
        for (Trainer* other : workers) other->ctx_.cancel();
      throw;
    }
    by[part] = w;
  };
  shared.done = [&](std::size_t part) {
    if (!total) {
      total = std::move(made[part]);
    } else {
      total->sums.add(made[part]->sums);
      for (std::size_t i = 0; i < total->gradients.size(); ++i) total->gradients[i] += made[part]->gradients[i];
    }
    made[part].reset();
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
  keep_kinds(workers, by);
  write_moved(&LearntTensor::gradient, total->gradients);
  return total->sums;
}

}  // namespace vsplat
