// The page about a fit, for a browser: curves, held-out pictures with their drawings, where the time went, settings. It
// has no script, fetches nothing, and can be moved.
#pragma once
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "data_uri.h"

namespace command {

// What vsplat_fit_progress said after one of the steps, and the seconds since the first step began.
struct FitStep {
  std::size_t phase = 0;  // its place among FitPage::phases
  std::int64_t step = 0;  // of the phase
  std::uint64_t gaussians = 0;
  double loss = 0, psnr = 0, seconds = 0;
};

// A picture compared with its drawing. The others are data URIs, "" if left out for the page's size.
struct FittedPicture {
  std::string name;
  double psnr = 0, psnr_cc = 0, ssim = 0;
  std::string given, drawn, difference;
};

struct FitPage {
  std::string scene, views, device, state;  // `state`: a sentence
  std::vector<std::string> phases;
  std::vector<FitStep> steps;
  std::vector<FittedPicture> pictures;
  std::string about_pictures;                                // what they are
  double before = 0, after = 0;                              // seconds before the first step and after the last
  std::vector<std::pair<std::string, std::string>> figures;  // what is shown large, with its name
  std::vector<vsplat_profile_row> profile;                   // empty: not recorded
  const nlohmann::ordered_json* settings = nullptr;          // an object; may be null
};

// Its pictures are scaled down.
FittedPicture fitted_picture(const std::string& name, const vsplat_comparison& scores, const Colours& given,
                             const Colours& drawn);

std::string fit_page_text(const FitPage& page);

}  // namespace command
