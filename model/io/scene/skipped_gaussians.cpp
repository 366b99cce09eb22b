#include "model/io/scene/skipped_gaussians.h"

#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {

GaussianSkips::GaussianSkips(const std::string& name, SkippedGaussians* skipped) : name_(name), skipped_(skipped) {
  if (skipped_) *skipped_ = {};
}

void GaussianSkips::add(GaussianDefect defect, const std::string& described) {
  if (!skipped_)
    fail(Status::format, "{}: {} ({} leaves such Gaussians out)", name_, described, Option::skip_bad_gaussians);
  if (first_.empty()) first_ = described;
  count(defect);
}

void GaussianSkips::count(GaussianDefect defect) {
  switch (defect) {
    case GaussianDefect::huge_scale:
      ++skipped_->huge_scale;
      break;
    case GaussianDefect::zero_rotation:
      ++skipped_->zero_rotation;
      break;
    default:
      ++skipped_->not_finite;
  }
}

void GaussianSkips::report(std::uint64_t count) const {
  if (first_.empty()) return;
  warn(
      "{}: {} of {} Gaussians are left out: {} with values that are not finite, {} with scales too large, {} with "
      "rotations of length 0; the first is {}",
      name_, skipped_->total(), count, skipped_->not_finite, skipped_->huge_scale, skipped_->zero_rotation, first_);
}

}  // namespace vsplat
