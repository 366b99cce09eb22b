#include "model/evaluate/scene_measure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "model/fit/fit_picture.h"
#include "model/metrics/metrics.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr double PictureScores::*kFigures[] = {&PictureScores::psnr, &PictureScores::psnr_cc, &PictureScores::ssim,
                                               &PictureScores::lpips_alex, &PictureScores::lpips_vgg};

}  // namespace

PictureScores::PictureScores() : lpips_alex(std::numeric_limits<double>::quiet_NaN()), lpips_vgg(lpips_alex) {}

ComparedPhotograph compared_photograph(const Photographs& photographs, int view, int longest,
                                       const std::array<float, 3>& background) {
  LoadedPhotograph photograph(photographs, view);
  const std::string name = photograph.listed().name;
  WholeView whole = photograph.whole(longest);
  ComparedPhotograph out{whole.camera, std::move(whole.image), {}};
  // In place: four values a pixel become three.
  std::vector<float>& data = out.picture.data;
  const std::size_t count = data.size() / 4;
  for (std::size_t i = 0; i < count; ++i) {
    const float shown = 1 - data[4 * i + 3];
    for (std::size_t c = 0; c < 3; ++c) {
      const float v = data[4 * i + c] + shown * background[c];  // premultiplied
      if (!std::isfinite(v))
        fail(Status::input, "{}: pixel {}, {} holds {}, a finite number expected", name,
             i % static_cast<std::size_t>(out.picture.width), i / static_cast<std::size_t>(out.picture.width), v);
      data[3 * i + c] = std::clamp(v, 0.0f, 1.0f);
    }
  }
  data.resize(3 * count);
  out.picture.channels = 3;
  for (const float known : whole.known.data) out.known.push_back(known > 0.5f ? 1 : 0);
  return out;
}

PictureScores compare_drawing(Context& ctx, Image& drawn, const ComparedPhotograph& given,
                              const std::vector<const Lpips*>& lpips) {
  for (float& v : drawn.data) v = std::clamp(v, 0.0f, 1.0f);
  // As in a fit, the photograph has the drawing's colours where it is unknown.
  Image filled;
  if (!given.known.empty()) filled = given.picture;
  const std::size_t count = drawn.data.size() / 3;
  std::size_t known = count;
  for (std::size_t i = 0; i < given.known.size(); ++i)
    if (given.known[i] == 0) {
      --known;
      std::copy_n(&drawn.data[3 * i], 3, &filled.data[3 * i]);
    }
  const Image& picture = given.known.empty() ? given.picture : filled;
  PictureScores out;
  // Unknown pixels are equal, and windows without a known pixel alike; the means are over the others.
  const double windows = known_window_share(given.known, picture.width, picture.height);
  out.psnr = psnr(drawn, picture) + 10 * std::log10(static_cast<double>(known) / static_cast<double>(count));
  out.psnr_cc = psnr_cc(drawn, picture, given.known);
  const double similarity = ssim(drawn, picture);
  out.ssim = windows < 1 ? 1 - (1 - similarity) / windows : similarity;
  for (const Lpips* net : lpips)
    (net->net() == LpipsNet::alex ? out.lpips_alex : out.lpips_vgg) = net->distance(ctx, drawn, picture);
  return out;
}

PictureScores mean_of(const std::vector<PictureScores>& scores) {
  PictureScores out;
  const auto is_unknown = [](const PictureScores& each) { return std::isnan(each.psnr); };
  const auto unknown = std::count_if(scores.begin(), scores.end(), is_unknown);
  for (double PictureScores::*const figure : kFigures) {
    out.*figure = 0;
    for (const PictureScores& each : scores)
      if (!is_unknown(each)) out.*figure += each.*figure;
    out.*figure /= static_cast<double>(scores.size()) - static_cast<double>(unknown);
  }
  return out;
}

}  // namespace vsplat
