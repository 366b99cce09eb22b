#include "model/diagnose/selftest/checks.h"

#include <algorithm>
#include <cmath>

#include "model/diagnose/tune/check_chosen.h"
#include "runtime/fail.h"
#include "runtime/files/sha256.h"

namespace vsplat::selftest {
namespace {

std::string digest_of(const void* bits, std::size_t bytes) {
  Sha256 hash;
  hash.add(static_cast<const char*>(bits), bytes);
  return hash.hex();
}

// Relative to the largest expected value; absolute if all expected values are zero.
double largest_error(const float* got, const double* want, std::size_t count, std::size_t stride) {
  double largest = 0, worst = 0;
  for (std::size_t i = 0; i < count; i += stride) {
    const double error = std::abs(static_cast<double>(got[i]) - want[i]);
    if (!std::isfinite(error)) return INFINITY;
    worst = std::max(worst, error);
    largest = std::max(largest, std::abs(want[i]));
  }
  return largest > 0 ? worst / largest : worst;
}

}  // namespace

Checks::Checks(Context& context, Sizes sizes) : ctx(context), quick(sizes == Sizes::quick), all(sizes == Sizes::all) {
  ctx.collect(noted_);
}

Checks::~Checks() { ctx.stop_collecting(); }

void Checks::run(const std::string& name, const std::function<void(Checks&)>& work) {
  name_ = name;
  first_ = findings_.size();
  digests_.clear();
  for (again_ = false;; again_ = true) {
    at_ = first_;
    noted_.clear();
    kept_.clear();
    try {
      work(*this);
    } catch (const Error& e) {
      if (!tells_of_the_device(e))
        fail(e.status(), "self-test of {}, which tells nothing of the device: {}", name, e.what());
      Finding finding;
      finding.what = name;
      finding.kernels = take_kernels();
      finding.error = INFINITY;
      finding.right = false;
      finding.trouble = e.what();
      findings_.push_back(std::move(finding));
      return;
    }
    if (again_) return;
  }
}

std::vector<NamedKernel> Checks::take_kernels() {
  std::set<NamedKernel> out = kept_;
  for (const auto& [kernel, launches] : noted_) out.insert(kernel), launched_.insert(kernel);
  if (noted_.empty() && findings_.size() > first_)
    out.insert(findings_.back().kernels.begin(), findings_.back().kernels.end());
  noted_.clear();
  return {out.begin(), out.end()};
}

void Checks::keep() {
  const std::vector<NamedKernel> more = take_kernels();
  kept_.insert(more.begin(), more.end());
  if (findings_.size() > first_) kept_.insert(findings_.back().kernels.begin(), findings_.back().kernels.end());
}

bool Checks::begins(const char* what, const void* bits, std::size_t bytes) {
  const std::string digest = digest_of(bits, bytes);
  const std::size_t at = at_++ - first_;
  if (!again_) {
    digests_.push_back(digest);
    Finding finding;
    finding.what = name_ + ": " + what;
    finding.kernels = take_kernels();
    findings_.push_back(std::move(finding));
    return true;
  }
  take_kernels();
  if (at < digests_.size() && digests_[at] == digest) return false;
  Finding& finding = findings_.at(std::min(first_ + at, findings_.size() - 1));
  finding.right = false;
  finding.trouble = "other bits the second time";
  return false;
}

void Checks::ends(double error, double tolerance, bool right) {
  Finding& finding = findings_.back();
  finding.error = error;
  finding.tolerance = tolerance;
  finding.right = right;
}

void Checks::that(const char* what, bool right, double error, double tolerance) {
  if (begins(what, &right, sizeof right)) ends(error, tolerance, right);
}

void Checks::compare(const std::vector<float>& got, const std::vector<double>& want, double tolerance) {
  const double error = got.size() == want.size() ? largest_error(got.data(), want.data(), want.size(), 1) : INFINITY;
  ends(error, tolerance, error <= tolerance);
  findings_.back().zeros = std::all_of(want.begin(), want.end(), [](double v) { return v == 0; });
}

void Checks::compare_columns(const std::vector<float>& got, std::size_t columns, const std::vector<double>& want,
                             double tolerance) {
  double error = got.size() == want.size() ? 0 : INFINITY;
  for (std::size_t c = 0; std::isfinite(error) && c < std::min(columns, want.size()); ++c)
    error = std::max(error, largest_error(got.data() + c, want.data() + c, want.size() - c, columns));
  ends(error, tolerance, error <= tolerance);
  findings_.back().zeros = std::all_of(want.begin(), want.end(), [](double v) { return v == 0; });
}

Tensor Checks::gap(const Shape& shape) {
  long count = 1;
  for (const long n : shape) count *= n;
  return ctx.upload(shape, nans(static_cast<std::size_t>(count)));
}

Tensor Checks::zeros(const Shape& shape) {
  long count = 1;
  for (const long n : shape) count *= n;
  return ctx.upload(shape, std::vector<float>(static_cast<std::size_t>(count), 0.0f));
}

}  // namespace vsplat::selftest
