#include "model/fit/fit_pictures.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include "model/views/placement.h"
#include "runtime/fail.h"
#include "runtime/host_span.h"

namespace vsplat {
namespace {

constexpr std::size_t kDecoderShare = 6;  // what a decoder takes, in bytes of its picture
constexpr std::size_t kMostAhead = 8;     // pictures

std::vector<std::uint8_t> as_bytes(const Image& image, const std::string& name) {
  std::vector<std::uint8_t> out(image.data.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const float v = image.data[i];
    if (!std::isfinite(v)) {
      const std::size_t pixel = i / static_cast<std::size_t>(image.channels);
      fail(Status::input, "{}: the pixel at {}, {} is {}, a finite number expected", name,
           pixel % static_cast<std::size_t>(image.width), pixel / static_cast<std::size_t>(image.width), v);
    }
    out[i] = byte_of(v);
  }
  return out;
}

}  // namespace

FitPictures::FitPictures(const Photographs& photographs, const Similarity& to_world, int longest, std::size_t cap,
                         bool metric_depths)
    : photographs_(photographs), to_world_(to_world), longest_(longest), cap_(cap), metric_depths_(metric_depths) {}

std::shared_ptr<const FitPicture> FitPictures::load(int view) const {
  const HostSpan span(HostKind::host, "decode pictures", photographs_.set.views[static_cast<std::size_t>(view)].name);
  LoadedPhotograph photograph(photographs_, view);
  auto out = std::make_shared<FitPicture>();
  const std::string name = photograph.listed().name;
  out->masked = photograph.is_masked();
  const WholeView whole = photograph.whole(longest_);
  out->name = name;
  out->camera = to_frame(whole.camera, to_world_);
  out->rgba = as_bytes(whole.image, name);
  for (const float known : whole.known.data) out->known.push_back(known > 0.5f ? 1 : 0);
  out->depth = photograph.depths(whole);
  for (std::size_t i = 0; i < out->depth.size(); ++i) {
    const bool shows = (out->known.empty() || out->known[i] != 0) && out->rgba[4 * i + 3] > 127;
    out->depth[i] = !shows ? 0 : metric_depths_ ? static_cast<float>(out->depth[i] / to_world_.scale) : out->depth[i];
  }
  return out;
}

std::shared_ptr<const FitPicture> FitPictures::at(int view) {
  const auto there = cached_.find(view);
  if (there != cached_.end()) {
    ages_.splice(ages_.begin(), ages_, there->second.age);
    return there->second.picture;
  }
  std::future<std::shared_ptr<const FitPicture>> begun;
  if (const auto ahead = ahead_.find(view); ahead != ahead_.end()) {
    begun = std::move(ahead->second);
    ahead_.erase(ahead);
  }
  const std::shared_ptr<const FitPicture> picture = begun.valid() ? begun.get() : load(view);
  bytes_ += bytes_of(*picture);
  largest_ = std::max(largest_, bytes_of(*picture));
  while (bytes_ > cap_ && !ages_.empty()) forget(ages_.back());
  ages_.push_front(view);
  cached_.emplace(view, Cached{picture, ages_.begin()});
  cameras_[view] = picture->camera;
  return picture;
}

void FitPictures::limit(std::size_t cap) {
  cap_ = cap;
  while (bytes_ > cap_ && !ages_.empty()) forget(ages_.back());
}

Camera FitPictures::camera(int view) {
  const auto there = cameras_.find(view);
  return there != cameras_.end() ? there->second : at(view)->camera;
}

std::size_t FitPictures::most_ahead() const {
  const std::size_t affordable = 1 + cap_ / (2 * kDecoderShare * largest_);
  return std::min(
      {affordable, static_cast<std::size_t>(std::max(std::thread::hardware_concurrency(), 1u)), kMostAhead});
}

void FitPictures::read_ahead(const std::vector<int>& views) {
  if (photographs_.picture) return;
  const auto end = views.begin() + static_cast<std::ptrdiff_t>(std::min(views.size(), most_ahead()));
  std::erase_if(ahead_, [&](const auto& begun) { return std::find(views.begin(), end, begun.first) == end; });
  for (auto view = views.begin(); view != end; ++view)
    if (cached_.count(*view) == 0 && ahead_.count(*view) == 0)
      ahead_.emplace(*view, std::async(std::launch::async, [this, view = *view] { return load(view); }));
}

void FitPictures::forget(int view) {
  const auto there = cached_.find(view);
  if (there == cached_.end()) return;
  bytes_ -= bytes_of(*there->second.picture);
  ages_.erase(there->second.age);
  cached_.erase(there);
}

std::vector<Camera> FitPictures::cameras(const std::vector<int>& views) const {
  std::vector<Camera> out;
  for (const int view : views) {
    Camera camera = to_frame(resolved_view(photographs_, view).camera, to_world_);
    const int side = std::max(camera.width, camera.height);
    const double factor = longest_ > 0 && side > longest_ ? static_cast<double>(longest_) / side : 1.0;
    camera.width = static_cast<int>(std::ceil(factor * camera.width));
    camera.height = static_cast<int>(std::ceil(factor * camera.height));
    for (double* length : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *length *= factor;
    out.push_back(camera);
  }
  return out;
}

Camera FitPictures::largest(const std::vector<int>& views) const {
  Camera out;
  double most = 0;
  for (const Camera& camera : cameras(views)) {
    const double pixels = static_cast<double>(camera.width) * camera.height;
    if (pixels > most) out = camera;
    most = std::max(most, pixels);
  }
  return out;
}

}  // namespace vsplat
