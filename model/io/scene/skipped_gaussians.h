// Gaussians of a file that cannot be drawn: errors, or left out and counted.
#pragma once
#include <cstdint>
#include <string>

namespace vsplat {

// Counts the Gaussians of a file that cannot be drawn, by reason.
struct SkippedGaussians {
  std::uint64_t not_finite = 0;     // a value is NaN or infinite (except opacity logits: infinite ones mean 0 and 1)
  std::uint64_t huge_scale = 0;     // a scale's exponential exceeds a float's range
  std::uint64_t zero_rotation = 0;  // a quaternion of length 0

  std::uint64_t total() const { return not_finite + huge_scale + zero_rotation; }
};

enum class GaussianDefect : std::uint8_t { none, not_finite, huge_scale, zero_rotation };

// What a reader does with the Gaussians of one file that cannot be drawn.
class GaussianSkips {
 public:
  // `name` is the file's path. `skipped` is set to 0, or null: the first defect is an error.
  GaussianSkips(const std::string& name, SkippedGaussians* skipped);

  // `describe()` returns "Gaussian 3, rot_0 (byte 1234): ...". Throws Error(format) with it, or counts the defect.
  template <class F>
  void add(GaussianDefect defect, const F& describe) {
    if (!skipped_ || first_.empty())
      add(defect, std::string(describe()));
    else
      count(defect);
  }
  // Warns if some of `count` Gaussians were left out.
  void report(std::uint64_t count) const;

 private:
  void add(GaussianDefect defect, const std::string& described);
  void count(GaussianDefect defect);

  std::string name_;
  SkippedGaussians* skipped_;
  std::string first_;
};

}  // namespace vsplat
