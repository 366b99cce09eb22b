#include "model/evaluate/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <numeric>
#include <optional>

#include "model/base/pose_noise.h"
#include "model/base/scene.h"
#include "model/fit/scene_fit.h"
#include "model/io/picture/contact_sheet.h"
#include "model/metrics/metrics.h"
#include "model/networks/vsplat/ray_predictor.h"
#include "model/reconstruct/reconstruct.h"
#include "model/render/render.h"
#include "model/render/supersample.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/share_out.h"

namespace vsplat {
namespace {

constexpr std::array<float, 3> kWhite{1, 1, 1};
constexpr int kSmallestJudged = 11;  // a window of SSIM
constexpr int kLargestJudged = 4096;
constexpr double Scores::*kNumbers[] = {
    &Scores::psnr,        &Scores::psnr_coarse, &Scores::ssim,      &Scores::psnr_white,   &Scores::psnr_nearest,
    &Scores::selected,    &Scores::lpips_alex,  &Scores::lpips_vgg, &Scores::pose_degrees, &Scores::pose_distance,
    &Scores::ray_degrees, &Scores::ray_moment,  &Scores::gaussians, &Scores::seconds};

// Square pictures side by side, clamped, as the published protocol compares them.
class Strip {
 public:
  Strip(int edge, std::size_t count) : edge_(edge), image_(edge * static_cast<int>(count), edge, 3) {}

  void put(std::size_t place, const Image& picture) {
    for (int y = 0; y < edge_; ++y)
      std::transform(picture.at(0, y), picture.at(0, y) + row(), image_.at(static_cast<int>(place) * edge_, y),
                     [](float v) { return std::clamp(v, 0.0f, 1.0f); });
  }
  // Makes pixels white that the view does not show (EvaluationObject::shown).
  void leave_out(std::size_t place, const Image& shown) {
    for (int y = 0; y < shown.height; ++y)
      for (int x = 0; x < shown.width; ++x) {
        float* const pixel = image_.at(static_cast<int>(place) * edge_ + x, y);
        const float share = *shown.at(x, y);
        for (int c = 0; c < 3; ++c) pixel[c] = share * pixel[c] + (1 - share);
      }
  }
  Image at(std::size_t place) const {
    Image out(edge_, edge_, 3);
    for (int y = 0; y < edge_; ++y) std::copy_n(image_.at(static_cast<int>(place) * edge_, y), row(), out.at(0, y));
    return out;
  }
  const Image& image() const { return image_; }

 private:
  std::ptrdiff_t row() const { return static_cast<std::ptrdiff_t>(edge_) * 3; }

  int edge_;
  Image image_;
};

class Evaluator {
 public:
  Evaluator(const Evaluating& worker, const EvaluateOptions& options)
      : ctx_(worker.ctx),
        network_(worker.network),
        config_(worker.network.config()),
        lpips_(worker.lpips),
        options_(options) {}

  void check() const;
  // Edge of the compared pictures, in pixels.
  int judged() const { return options_.request.judged > 0 ? options_.request.judged : config_.image(); }
  EvaluationObject load(const DataObject& object, std::vector<std::string>& skipped,
                        std::vector<std::string>& missing) const {
    return evaluation_object(object, config_.taken(), options_.request, options_.skip_bad ? &skipped : nullptr,
                             &missing);
  }
  // Means over the draws of noise.
  Scores score(const EvaluationObject& object) const;
  // A sheet of these objects side by side: their inputs, and below them the compared pictures.
  Image sheet(const std::vector<const DataObject*>& objects) const;

 private:
  struct Drawn {
    Strip truth, coarse, result;
    Scores poses;         // scores of poses and rays, of the network's time and result
    double selected = 0;  // a share
  };

  Drawn draw(const EvaluationObject& object, int noise_draw = 0) const;
  Scores score(const EvaluationObject& object, int noise_draw) const;
  Strip render_all(const DeviceGaussians& gaussians, const EvaluationObject& object, float near,
                   const std::optional<std::array<float, 3>>& mirror, const std::optional<Detail>& detail) const;
  Scene reconstructed(const EvaluationObject& object, const std::vector<int>& views) const;
  Strip render_refined(const EvaluationObject& object) const;

  Context& ctx_;
  const Network& network_;
  const AnyConfig& config_;
  const std::vector<const Lpips*>& lpips_;
  const EvaluateOptions& options_;
};

void Evaluator::check() const {
  if (options_.request.judged > 0 && (judged() < kSmallestJudged || judged() > kLargestJudged))
    fail(Status::usage,
         "vsplat_evaluate_options.picture_size is {}: pictures that are compared have {} to {} pixels an edge",
         judged(), kSmallestJudged, kLargestJudged);
  if (const int most = config_.taken().most; options_.request.inputs < 0 || options_.request.inputs > most)
    fail(Status::usage, "vsplat_evaluate_options.view_count is {}: {} takes 1 to {}", options_.request.inputs,
         config_.network(), most);
  if (!(options_.pose_noise >= 0 && options_.pose_noise <= 1))
    fail(Status::usage, "vsplat_evaluate_options.pose_noise is {}: 0 to 1 expected", options_.pose_noise);
  if (options_.pose_draws < 1 || options_.pose_draws > 1000)
    fail(Status::usage, "vsplat_evaluate_options.pose_draws is {}: 1 to 1000 expected", options_.pose_draws);
  if (options_.pose_noise > 0 && options_.refine)
    fail(Status::usage,
         "vsplat_evaluate_options.refine is not measured under vsplat_evaluate_options.pose_noise: the fit uses the "
         "listed poses");
  for (const Lpips* lpips : lpips_)
    if (lpips->smallest() > judged())
      fail(Status::usage, "LPIPS ({}) needs pictures of at least {} pixels, those compared have {}",
           name_of(lpips->net()), lpips->smallest(), judged());
}

Strip Evaluator::render_all(const DeviceGaussians& gaussians, const EvaluationObject& object, float near,
                            const std::optional<std::array<float, 3>>& mirror,
                            const std::optional<Detail>& detail) const {
  RenderOptions options = network_.drawing();
  options.background = kWhite;
  options.near = near;
  options.mirror = mirror;
  Strip out(judged(), object.novel());
  for (std::size_t i = 0; i < object.novel(); ++i) {
    const Camera& camera = object.cameras[object.inputs + i];
    options.supersample = options_.supersample > 0 ? options_.supersample : detail ? samples_for(*detail, camera) : 1;
    out.put(i, render_picture(ctx_, gaussians, camera, options).colour);
    out.leave_out(i, object.shown[i]);
  }
  return out;
}

// Reconstructs from those inputs that are among `views`, in the user's world.
Scene Evaluator::reconstructed(const EvaluationObject& object, const std::vector<int>& views) const {
  std::vector<PreparedView> prepared;
  for (std::size_t i = 0; i < object.inputs; ++i)
    if (std::find(views.begin(), views.end(), object.input_views[i]) != views.end())
      prepared.push_back({object.pictures[i], to_frame(object.cameras[i], object.to_world.inverse())});
  ReconstructOptions options;
  options.forward.planned_selected = options_.planned_selected;
  return reconstruct(ctx_, network_, prepared, object.framed.placement, options).scene;
}

// Fits the scene to the inputs only: the compared views are not used.
Strip Evaluator::render_refined(const EvaluationObject& object) const {
  FitRequest request;
  for (const int view : object.input_views) request.names.push_back(fmt::format("@{}", view));
  const auto make = [&](const std::vector<int>& views) { return reconstructed(object, views); };
  SceneFit fit(ctx_, object.framed.photographs, {object.framed.placement, make, true}, request);
  while (fit.step()) {
  }
  Scene scene = fit.result().scene;
  transform(scene, object.to_world.inverse());
  return render_all(upload(ctx_, scene.gaussians), object, scene.near, scene.mirror, {});
}

Evaluator::Drawn Evaluator::draw(const EvaluationObject& object, int noise_draw) const {
  const int edge = config_.image();
  std::vector<float> pictures;
  for (std::size_t i = 0; i < object.inputs; ++i)
    pictures.insert(pictures.end(), object.pictures[i].data.begin(), object.pictures[i].data.end());
  const Tensor input = ctx_.upload({static_cast<long>(object.inputs), edge, edge, 3}, pictures, Type::f32, "pictures");
  const std::vector<Camera> listed(object.cameras.begin(),
                                   object.cameras.begin() + static_cast<std::ptrdiff_t>(object.inputs));
  const bool noisy = options_.pose_noise > 0;
  const std::vector<Camera> cameras = noisy ? noisy_cameras(listed, options_.pose_noise, options_.request.seed,
                                                            static_cast<std::uint32_t>(noise_draw), object.name)
                                            : listed;
  ForwardOptions forward;
  forward.planned_selected = options_.planned_selected;
  ctx_.finish();
  const auto begun = std::chrono::steady_clock::now();
  const Network::Result result = network_.forward(ctx_, input, cameras, forward);
  ctx_.finish();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
  const double selected = static_cast<double>(result.voxels.size()) / std::pow(result.volume, 3);
  Scores poses;
  poses.seconds = took.count();
  poses.gaussians = static_cast<double>((config_.has_fine() ? result.final : result.coarse).count());
  if (noisy) {
    const PoseErrors off = pose_errors(cameras, listed);
    poses.pose_degrees = off.degrees, poses.pose_distance = off.distance;
  }
  if (result.rays) {
    const Config& config = *config_.as<Config>();
    const RayErrors off = ray_errors(ctx_.read<float>(result.rays), patch_rays(listed, config.tokens(), config.patch));
    poses.ray_degrees = off.degrees, poses.ray_moment = off.moment;
  }
  Strip truth(judged(), object.novel());
  for (std::size_t i = 0; i < object.novel(); ++i) truth.put(i, object.pictures[object.inputs + i]);
  const std::optional<std::array<float, 3>> mirror = network_.drawing().mirror;
  const std::optional<Detail> detail = detail_of(listed, Eigen::Vector3d::Zero());
  const auto drawn = [&](const DeviceGaussians& gaussians) {
    return render_all(gaussians, object, static_cast<float>(kNearInObject), mirror, detail);
  };
  const Strip coarse = drawn(result.coarse);
  // Without a selected voxel there is nothing to fit.
  if (options_.refine && result.final.count() > 0) return {truth, coarse, render_refined(object), poses, selected};
  return {truth, coarse, config_.has_fine() ? drawn(result.final) : coarse, poses, selected};
}

Scores mean_of(const std::vector<ObjectScores>& objects) {
  Scores out;
  for (double Scores::*const number : kNumbers) {
    out.*number = 0;
    for (const ObjectScores& object : objects) out.*number += object.scores.*number;
    out.*number /= static_cast<double>(objects.size());
  }
  return out;
}

Scores Evaluator::score(const EvaluationObject& object) const {
  std::vector<ObjectScores> draws;
  for (int i = 0; i < (options_.pose_noise > 0 ? options_.pose_draws : 1); ++i)
    draws.push_back({object.name, score(object, i)});
  return mean_of(draws);
}

// Share of the compared pixels that photographs show, 0 to 1: elsewhere pictures are equal.
double share_shown(const EvaluationObject& object) {
  double sum = 0, all = 0;
  for (const Image& shown : object.shown) {
    const double pixels = static_cast<double>(object.judged) * object.judged;
    all += pixels;
    sum += shown.empty() ? pixels : std::accumulate(shown.data.begin(), shown.data.end(), 0.0);
  }
  return sum / all;
}

Scores Evaluator::score(const EvaluationObject& object, int noise_draw) const {
  const Drawn drawn = draw(object, noise_draw);
  const Image &truth = drawn.truth.image(), &result = drawn.result.image();
  Strip nearest(judged(), object.novel());
  for (std::size_t i = 0; i < object.novel(); ++i) {
    nearest.put(i, object.input_judged(object.nearest[i]));
    nearest.leave_out(i, object.shown[i]);
  }
  Scores out = drawn.poses;
  const double of_shown = 10 * std::log10(share_shown(object));
  out.psnr = psnr(result, truth) + of_shown;
  out.psnr_coarse = psnr(drawn.coarse.image(), truth) + of_shown;
  out.ssim = ssim(result, truth);
  out.psnr_white = psnr(Image(truth.width, truth.height, 3, 1.0f), truth) + of_shown;
  out.psnr_nearest = psnr(nearest.image(), truth) + of_shown;
  out.selected = drawn.selected;
  for (const Lpips* lpips : lpips_)
    (lpips->net() == LpipsNet::alex ? out.lpips_alex : out.lpips_vgg) = lpips->distance(ctx_, result, truth);
  return out;
}

Image Evaluator::sheet(const std::vector<const DataObject*>& objects) const {
  constexpr std::size_t kViews = 4;
  const Image blank(judged(), judged(), 3, ContactSheet::paper);
  // with their labels, at the first picture of each object
  std::array<std::vector<std::pair<Image, std::string>>, 4> rows;
  for (const DataObject* listed : objects) {
    std::vector<std::string> told;
    const EvaluationObject object = load(*listed, told, told);
    const Drawn drawn = draw(object);
    for (std::size_t i = 0; i < kViews; ++i) {
      const auto label = [&](const std::string& text) { return i == 0 ? text : ""; };
      rows[0].emplace_back(i < object.inputs ? object.pictures[i] : blank, label(listed->name));
      std::size_t row = 0;
      const std::array<const char*, 3> names = {"truth", "coarse", "result"};
      for (const Strip* strip : {&drawn.truth, &drawn.coarse, &drawn.result}) {
        rows[row + 1].emplace_back(i < object.novel() ? strip->at(i) : blank, label(names[row]));
        ++row;
      }
    }
  }
  ContactSheet sheet({.cell = 256, .columns = static_cast<int>(rows[0].size()), .expected = 0});
  for (const auto& row : rows)
    for (const auto& [picture, label] : row) sheet.add(picture, label);
  return sheet.sheet();
}

// Indices of the best, the median and the worst object, or fewer if there are not as many.
std::vector<std::size_t> typical(const std::vector<ObjectScores>& objects) {
  std::vector<std::size_t> ranked(objects.size());
  for (std::size_t i = 0; i < ranked.size(); ++i) ranked[i] = i;
  std::stable_sort(ranked.begin(), ranked.end(),
                   [&](std::size_t a, std::size_t b) { return objects[a].scores.psnr > objects[b].scores.psnr; });
  std::vector<std::size_t> out = {ranked.front()};
  if (ranked.size() > 2) out.push_back(ranked[ranked.size() / 2]);
  if (ranked.size() > 1) out.push_back(ranked.back());
  return out;
}

}  // namespace

Scores::Scores()
    : lpips_alex(std::numeric_limits<double>::quiet_NaN()),
      lpips_vgg(lpips_alex),
      pose_degrees(lpips_alex),
      pose_distance(lpips_alex),
      ray_degrees(lpips_alex),
      ray_moment(lpips_alex) {}

namespace {

// An evaluation in progress, shared by all workers.
class Evaluated {
 public:
  // `own`: number of objects of this process.
  Evaluated(const DataSet& data, const EvaluateOptions& options, std::size_t own)
      : data_(data), options_(options), own_(own), found_(data.objects.size()) {}

  // Called by one worker, in parallel with others.
  void score(const Evaluator& evaluator, std::size_t item) {
    const DataObject& listed = data_.objects[item];
    if (options_.progress) {
      const std::lock_guard lock(telling_);
      options_.progress(listed.name, static_cast<double>(std::min(begun_++, own_)) / static_cast<double>(own_));
    }
    EvaluationObject object;
    std::vector<std::string> skipped, missing;
    try {
      object = evaluator.load(listed, skipped, missing);
    } catch (const Error& e) {
      if (!options_.skip_bad || !is_about_data(e)) throw;
      warn("an object is left out: {}", e.what());
      return;
    }
    for (const std::string& text : missing) warn("object {}: {}", listed.name, text);
    for (const std::string& text : skipped) warn("a view is left out: {}", text);
    const Scores s = evaluator.score(object);
    verbose("{}: PSNR {:.2f} dB (coarse {:.2f}, white {:.2f}, nearest view {:.2f}), {:.1f} % of the voxels selected",
            object.name, s.psnr, s.psnr_coarse, s.psnr_white, s.psnr_nearest, 100 * s.selected);
    found_[item] = ObjectScores{object.name, s};
  }
  // Sends this rank's results of its items to rank 0, and receives them there.
  void put(MessageOut& out, const std::vector<std::size_t>& items) const {
    for (const std::size_t item : items) {
      out.add(found_[item].has_value());
      if (found_[item]) out.add(found_[item]->name).add(found_[item]->scores);
    }
  }
  void take(MessageIn& from, const std::vector<std::size_t>& items) {
    for (const std::size_t item : items) {
      if (!from.take<bool>()) continue;
      const std::string name = from.take_text();
      found_[item] = ObjectScores{name, from.take<Scores>()};
    }
  }
  // Called in the data set's order.
  void add(std::size_t item) {
    if (!found_[item]) {
      ++out_.skipped;
      return;
    }
    evaluated_.push_back(&data_.objects[item]);
    out_.objects.push_back(*found_[item]);
    if (options_.on_object && (!options_.ranks || options_.ranks->rank() == 0)) {
      const std::lock_guard lock(telling_);
      options_.on_object(out_.objects.back());
    }
  }
  // Result of a rank other than 0; empty if it failed, which rank 0 reports.
  Evaluation own_result(bool whole) {
    if (whole && !out_.objects.empty()) out_.mean = mean_of(out_.objects);
    return std::move(out_);
  }
  Evaluation result(const Evaluator& evaluator) {
    if (out_.objects.empty()) fail(Status::input, "none of the {} objects could be evaluated", data_.objects.size());
    out_.mean = mean_of(out_.objects);
    if (options_.sheet) {
      // Renders again, since keeping every object's pictures would need unbounded memory.
      std::vector<const DataObject*> shown;
      for (const std::size_t i : typical(out_.objects)) shown.push_back(evaluated_[i]);
      out_.sheet = evaluator.sheet(shown);
    }
    return std::move(out_);
  }

 private:
  const DataSet& data_;
  const EvaluateOptions& options_;
  const std::size_t own_;
  std::mutex telling_;
  std::size_t begun_ = 0;
  std::vector<std::optional<ObjectScores>> found_;
  std::vector<const DataObject*> evaluated_;
  Evaluation out_;
};

// Items of a rank: every count-th, so that the ranks have equal numbers.
std::vector<std::size_t> items_of(const DataSet& data, int count, int rank) {
  std::vector<std::size_t> out;
  for (auto i = static_cast<std::size_t>(rank); i < data.objects.size(); i += static_cast<std::size_t>(count))
    out.push_back(i);
  return out;
}

// Runs on the other ranks; returns whether all their items are done.
template <class F>
bool told_to_rank_0(Ranks& ranks, const F& evaluate_own, const Evaluated& evaluated,
                    const std::vector<std::size_t>& own) {
  MessageOut out;
  bool whole = false;
  try {
    evaluate_own();
    out.add(Status::ok);
    evaluated.put(out, own);
    whole = true;
  } catch (const Error& e) {
    out.add(e.status()).add(std::string(e.what()));
  }
  ranks.send(0, out.bytes());
  return whole;
}

// Runs on rank 0: evaluates its own items and collects the others', reported in order up to the first missing one. Its
// own error takes precedence.
template <class F>
void gather(Ranks& ranks, const F& evaluate_own, Evaluated& evaluated, const DataSet& data) {
  std::exception_ptr failed;
  std::vector<bool> is_there(data.objects.size());
  const auto take_note = [&](int rank) {
    for (const std::size_t item : items_of(data, ranks.count(), rank)) is_there[item] = true;
  };
  try {
    evaluate_own();
    take_note(0);
  } catch (...) {
    failed = std::current_exception();
  }
  for (int rank = 1; rank < ranks.count(); ++rank) {
    MessageIn message(ranks.receive(rank));
    if (const auto status = message.take<Status>(); status != Status::ok) {
      if (!failed)
        failed = std::make_exception_ptr(Error(status, fmt::format("rank {}: {}", rank, message.take_text())));
      continue;
    }
    evaluated.take(message, items_of(data, ranks.count(), rank));
    take_note(rank);
  }
  for (std::size_t i = 0; i < is_there.size() && (is_there[i] || !failed); ++i) evaluated.add(i);
  if (failed) std::rethrow_exception(failed);
}

}  // namespace

Evaluation evaluate(Context& ctx, const Network& network, const DataSet& data, const EvaluateOptions& options) {
  return evaluate({{ctx, network}}, data, options);
}

Evaluation evaluate(const std::vector<Evaluating>& workers, const DataSet& data, const EvaluateOptions& options,
                    const std::function<void(std::size_t worker, const Error& error)>& lost) {
  std::vector<Evaluator> evaluators;
  for (const Evaluating& worker : workers) evaluators.emplace_back(worker, options);
  for (const Evaluator& evaluator : evaluators) evaluator.check();
  std::vector<bool> gone(workers.size());
  const bool alone = !options.ranks || options.ranks->count() == 1;
  const int rank = alone ? 0 : options.ranks->rank();
  const std::vector<std::size_t> own = items_of(data, alone ? 1 : options.ranks->count(), rank);
  Evaluated evaluated(data, options, own.size());
  const auto evaluate_own = [&] {
    share_out({.items = own.size(),
               .workers = workers.size(),
               .ahead = own.size(),  // results are only numbers
               .work = [&](std::size_t worker, std::size_t i) { evaluated.score(evaluators[worker], own[i]); },
               .done =
                   [&](std::size_t i) {
                     if (alone || rank > 0) evaluated.add(own[i]);
                   },
               .lost =
                   [&](std::size_t worker, std::size_t, const Error& error) {
                     gone[worker] = true;
                     if (lost) lost(worker, error);
                   }});
  };
  if (alone)
    evaluate_own();
  else if (rank > 0)
    return evaluated.own_result(told_to_rank_0(*options.ranks, evaluate_own, evaluated, own));
  else
    gather(*options.ranks, evaluate_own, evaluated, data);
  return evaluated.result(
      evaluators[static_cast<std::size_t>(std::find(gone.begin(), gone.end(), false) - gone.begin())]);
}

}  // namespace vsplat
