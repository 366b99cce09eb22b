#include "fit_job.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "arguments.h"
#include "difference.h"
#include "naming.h"
#include "runtime/system/system.h"

namespace command {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t most_rows = 24, large_rows = 8;
constexpr int large_cell = 512;
constexpr double page_every = 30;  // seconds from one page of a fit in progress to the next
constexpr std::int64_t curve_points = 300;

std::string two_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

std::string decibels(double psnr) { return two_digits(psnr) + " dB"; }

std::string progress_text(const vsplat_fit_progress& p) {
  char text[160];
  char loss[32] = "";  // empty before the first step
  if (!std::isnan(p.loss)) std::snprintf(loss, sizeof loss, ", loss %.4f", p.loss);
  std::snprintf(text, sizeof text, "%s: step %lld of %lld%s, %llu Gaussians", p.phase, static_cast<long long>(p.step),
                static_cast<long long>(p.steps), loss, static_cast<unsigned long long>(p.gaussians));
  std::string out = text;
  if (!std::isnan(p.psnr)) out += ", held out " + decibels(p.psnr);
  if (p.seconds_left > 0.5) out += ", about " + seconds_text(p.seconds_left) + " left";
  return out;
}

std::string state_text(const vsplat_fit_progress& p) {
  return "At " + std::string(p.phase) + ", step " + std::to_string(p.step) + " of " + std::to_string(p.steps) +
         ", when this page was made.";
}

// Shows every step on a terminal; in a log the start of each phase and a line every few seconds.
class Teller {
 public:
  explicit Teller(const Common& common) : common_(common) {}
  void tell(const vsplat_fit_progress& p) {
    const double now = elapsed_seconds();
    const bool terminal = vsplat::sys::error_output_is_terminal();
    if (now - last_ < (terminal ? 0.1 : 5) && !(common_.verbose && phase_ != p.phase)) return;
    terminal ? show_progress(common_, progress_text(p)) : say(common_, progress_text(p));
    last_ = now;
    phase_ = p.phase;
  }

 private:
  const Common& common_;
  std::string phase_;
  double last_ = elapsed_seconds();
};

// When to ask for the progress, which waits for the loss, so that the device has nothing to do until the next step
// begins: after every step for a log, else as often as curves and people need it.
class Asking {
 public:
  explicit Asking(bool always) : always_(always) {}
  bool is_due(const vsplat_fit_progress& last) {
    ++steps_;
    if (!always_ && curve_points * steps_ < last.steps && elapsed_seconds() - asked_ < 0.1) return false;
    steps_ = 0;
    asked_ = elapsed_seconds();
    return true;
  }

 private:
  bool always_;
  std::int64_t steps_ = 0;  // since asking
  double asked_ = 0;
};

// log.csv. The last line has the `psnr_cc` of the scene that is written, if it was measured.
std::string log_text(const FitPage& page, double psnr_cc) {
  std::string out = "step,phase,loss,gaussians,psnr,seconds,psnr_cc\n";
  for (const FitStep& s : page.steps) {
    char line[192];
    std::snprintf(line, sizeof line, "%lld,%s,%.6g,%llu,", static_cast<long long>(s.step), page.phases[s.phase].c_str(),
                  s.loss, static_cast<unsigned long long>(s.gaussians));
    out += line;
    if (!std::isnan(s.psnr)) {
      std::snprintf(line, sizeof line, "%.4f", s.psnr);
      out += line;
    }
    std::snprintf(line, sizeof line, ",%.3f,\n", s.seconds);
    out += line;
  }
  if (std::isfinite(psnr_cc) && !page.steps.empty()) out.insert(out.size() - 1, two_digits(psnr_cc));
  return out;
}

// Without what is masked.
vsplat_comparison scores_of(const vsplat_measured& from) {
  vsplat_comparison out = VSPLAT_COMPARISON_INIT;
  out.psnr = from.psnr, out.psnr_cc = from.psnr_cc, out.ssim = from.ssim;
  return out;
}

std::string pictures_text(std::size_t count) { return std::to_string(count) + (count == 1 ? " picture" : " pictures"); }

ordered_json number_json(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(); }

}  // namespace

void FitJob::expect(Outputs& outputs, const std::string& output) {
  output_ = output;
  if (options.poses) poses_ = std::filesystem::path(output).replace_extension(".poses.json").string();
  outputs.expect(poses_);
  outputs.expect(log_);
  outputs.expect(sheet_);
  outputs.expect(record_);
  // A fit that was killed may have left its page.
  options.resume ? outputs.expect_renewed(page_path_) : outputs.expect(page_path_);
}

std::vector<std::string> FitJob::names_of(const vsplat::Fit& fit, vsplat_fit_views which,
                                          const vsplat::Views& views) const {
  std::vector<std::string> out;
  for (const std::int32_t view : fit.views(which)) out.push_back(views.name(static_cast<std::size_t>(view)));
  return out;
}

vsplat::Scene FitJob::run(Session& session, const Common& common, const vsplat::Views& views, Outputs& outputs,
                          const std::function<void(const vsplat::Scene&)>& on_start,
                          const std::function<void(const vsplat::Scene&)>& on_result) {
  session.start("fitting");
  show_progress(common, "fitting: reading pictures");
  const vsplat::Fit fit = naming({from}, {checkpoint_}, [&] { return vsplat::Fit(session.device(), views, options); });
  if (on_start) on_start(fit.start());
  Teller teller(common);
  settle(fit);
  page_.scene = std::filesystem::path(output_).filename().string();
  page_.views = from;
  page_.device = session.device().info().name;
  const double begun = elapsed_seconds();
  page_.before = begun - since;
  double paged = begun;
  begin_live(common, fit, views);
  vsplat_fit_progress progress = VSPLAT_FIT_PROGRESS_INIT;
  Asking asking(!log_.empty());
  for (bool more = true; more;) {
    if (interrupted()) {
      fit.stop();
      stopped_ = true;
      break;
    }
    const bool due = asking.is_due(progress);
    more = due ? fit.step(progress) : fit.step();
    if (more && !due) continue;
    if (!due) fit.step(progress);  // runs no step
    teller.tell(progress);
    remember(progress, elapsed_seconds() - begun);
    if (live_) {
      live_->at(progress_text(progress),
                progress.steps > 0 ? static_cast<double>(progress.step) / static_cast<double>(progress.steps) : 0);
      if (more && live_->is_due()) show_live(session, fit, views);
    }
    if (page_path_.empty() || elapsed_seconds() - paged < page_every) continue;
    try {
      write_page(session, outputs);
    } catch (const std::exception& e) {  // the fit goes on
      warn(page_path_ + " is not kept up to date: " + e.what());
      paged = INFINITY;
      continue;
    }
    paged = elapsed_seconds();
  }
  clear_progress();
  if (live_ && common.verbose)
    say(common, "the page took " + seconds_text(live_->spent()) + " of the fit's " +
                    seconds_text(elapsed_seconds() - begun) + ", for " + std::to_string(live_->versions()) + " scenes");
  result_ = fit.result();
  measured_on_ = names_of(fit, VSPLAT_FIT_HELD_OUT, views);
  outliers_ = names_of(fit, VSPLAT_FIT_OUTLIERS, views);
  start_ = fit.start();
  vsplat::Scene scene = fit.scene();
  // They are corrected for the fitted scene, and do not apply to the start.
  if (result_.returned) poses_.clear();
  if (!poses_.empty()) fit.save_cameras(outputs.begin(poses_));
  try {
    measure(session, fit, scene, views);
  } catch (const std::exception& e) {  // what was fitted is not lost
    warn(std::string("the result is not measured on its pictures: ") + e.what());
  }
  on_result(scene);
  std::string failed;
  const auto write = [&](const std::string& path, const std::function<void()>& file) {
    if (path.empty()) return;
    try {
      file();
      outputs.keep();
    } catch (const std::exception& e) {
      outputs.drop();
      failed += (failed.empty() ? "" : "; ") + path + " is not: " + e.what();
    }
  };
  write(log_, [&] { write_text(outputs.begin(log_), log_text(page_, psnr_cc_)); });
  write(record_, [&] { write_record(session, fit, scene, outputs); });
  write(page_path_, [&] { end_page(session, scene, outputs, begun); });
  write(sheet_, [&] { draw_sheet(session, fit, scene, outputs); });
  if (!failed.empty()) throw std::runtime_error((output_.empty() ? "" : output_ + " is written; ") + failed);
  return scene;
}

Plan FitJob::plan(const Session& session, const vsplat::Views& views) {
  options.checkpoint = nullptr, options.resume = 0;
  const double begun = elapsed_seconds();
  const vsplat::Fit fit = naming({from}, {}, [&] { return vsplat::Fit(session.device(), views, options); });
  const ordered_json settings = ordered_json::parse(fit.settings());
  vsplat_fit_progress progress = VSPLAT_FIT_PROGRESS_INIT;
  const double stepped = elapsed_seconds();
  bool more = true;
  for (int steps = 0; more && !interrupted(); ++steps) {
    if (progress.seconds_left > 0 && steps >= 20 && elapsed_seconds() - stepped > 1) break;
    more = fit.step(progress);
  }
  const double took = elapsed_seconds() - begun;
  const ordered_json& most = settings["derived"]["max_gaussians"];
  const std::uint64_t gaussians = most.is_number()         ? most.get<std::uint64_t>()
                                  : progress.gaussians > 0 ? progress.gaussians
                                                           : fit.start().info().count;
  const ordered_json& picture = settings["derived"]["picture"];
  char title[160];
  std::snprintf(title, sizeof title, "the fit: up to %llu Gaussians of degree %d, pictures of %d x %d",
                static_cast<unsigned long long>(gaussians), settings["sh"].get<int>(), picture[0].get<int>(),
                picture[1].get<int>());
  Plan out = {title, fit.plan()};
  if (!interrupted())
    out.time = {settings["steps"].is_number() ? progress.steps : 0, took + (more ? progress.seconds_left : 0)};
  return out;
}

void FitJob::remember(const vsplat_fit_progress& p, double seconds) {
  if (log_.empty() && page_path_.empty() && !live_) return;
  page_.state = state_text(p);
  if (page_.phases.empty() || page_.phases.back() != p.phase) page_.phases.emplace_back(p.phase);
  page_.steps.push_back({page_.phases.size() - 1, p.step, p.gaussians, p.loss, p.psnr, seconds});
}

// Compares the scene with the pictures that were held out from the beginning to the end. For the page alone, and if
// there are none, with some of those that it was fitted to.
void FitJob::measure(const Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene,
                     const vsplat::Views& views) {
  const bool in_turn = result_.in_turn != 0, are_held_out = !in_turn && !measured_on_.empty();
  if (!are_held_out && page_path_.empty()) return;
  std::vector<std::int32_t> which = fit.views(are_held_out ? VSPLAT_FIT_HELD_OUT : VSPLAT_FIT_USED);
  const std::size_t all = which.size();
  if (!are_held_out && all > most_rows)
    for (std::size_t row = 0; row < most_rows; ++row) which[row] = which[row * all / most_rows];
  if (!are_held_out) which.resize(std::min(all, most_rows));
  std::vector<vsplat_camera> cameras;  // as corrected
  cameras.reserve(which.size());
  for (const std::int32_t view : which) cameras.push_back(fit.camera(static_cast<std::size_t>(view)));
  vsplat_measure_options how = VSPLAT_MEASURE_OPTIONS_INIT;
  how.views = which.data();
  how.num_views = which.size();
  if (!result_.returned) how.cameras = cameras.data();  // the corrections are of the fitted scene
  how.longest = longest_;
  how.masks = options.masks;
  how.invert_masks = options.invert_masks;
  std::copy(std::begin(result_.background), std::end(result_.background), how.background);
  if (sky_ && result_.returned) std::fill_n(how.background, 3, 0.5f);  // the sky that the start was measured before
  const vsplat_measured mean =
      vsplat::measure(session.device(), scene, views, how, [&](const vsplat_measured& picture) {
        const std::string name = views.name(static_cast<std::size_t>(picture.view));
        if (page_path_.empty() || page_.pictures.size() >= most_rows)
          page_.pictures.push_back({name, picture.psnr, picture.psnr_cc, picture.ssim, {}, {}, {}});
        else
          page_.pictures.push_back(fitted_picture(name, scores_of(picture),
                                                  {picture.given, picture.width, picture.height},
                                                  {picture.drawn, picture.width, picture.height}));
        return true;
      });
  if (are_held_out) psnr_cc_ = mean.psnr_cc;
  page_.about_pictures =
      are_held_out       ? "Held out: no step was fitted to them."
      : result_.returned ? "These were not held out. The drawings are of the start, which is what is written."
      : in_turn ? "Each view was left out in turn to find the number of steps. The scene that is written was fitted "
                  "to all of them: these figures say little about others."
                : "None was held out: the scene was fitted to these.";
  measured_ = are_held_out ? page_.pictures.size() : 0;
}

// What the fit does, as the options and the library describe it.
void FitJob::settle(const vsplat::Fit& fit) {
  const ordered_json effective = ordered_json::parse(fit.settings());
  settings_ = given_settings;
  for (auto& [name, value] : settings_.items())
    if ((value.is_null() || value == false) && effective.contains(name)) value = effective[name];
  for (const auto& [name, otherwise] :
       {std::pair("start", "auto"), std::pair("holdout", "auto"), std::pair("crop", "auto")})
    if (settings_.contains(name) && settings_[name].is_null()) settings_[name] = otherwise;
  derived_ = effective["derived"];
  longest_ = effective["size"].is_number() ? effective["size"].get<int>() : 0;
  sky_ = effective["background"] == "sky";
}

// SCENE.fit.json. Its fields are those of fit_record_fields.
void FitJob::write_record(const Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene,
                          Outputs& outputs) const {
  const vsplat_device_info info = session.device().info();
  ordered_json device = {{"name", info.name}, {"driver", info.driver}};
  session.add_numerics(device);
  ordered_json figures = {{"seconds", result_.seconds},
                          {"peak_bytes", result_.peak},
                          {"stopped", stopped_},
                          {"background", result_.background}};
  add_results(figures);
  const ordered_json out = {{"vsplat", vsplat_version_string()},
                            {"views", from},
                            {"scene", output_},
                            {"device", device},
                            {"settings", settings_},
                            {"derived", derived_},
                            {"counts",
                             {{"views", fit.views(VSPLAT_FIT_USED).size()},
                              {"held_out", measured_},
                              {"start", start_.info().count},
                              {"gaussians", scene.info().count}}},
                            {"figures", figures}};
  write_text(outputs.begin(record_), out.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n");
}

void FitJob::write_page(const Session& session, Outputs& outputs) {
  page_.settings = &settings_;
  if (session.recorded()) page_.profile = session.device().profile_rows();
  const std::string text = fit_page_text(page_);
  write_text(outputs.begin(page_path_), text);
}

void FitJob::begin_live(const Common& common, const vsplat::Fit& fit, const vsplat::Views& views) {
  if (live_port_.empty()) return;
  std::vector<PageCamera> cameras;
  for (const std::int32_t view : fit.views(VSPLAT_FIT_USED))
    cameras.push_back({views.name(static_cast<std::size_t>(view)), fit.camera(static_cast<std::size_t>(view))});
  live_ = std::make_unique<LiveFit>(common, live_port_, page_.scene, std::move(cameras));
}

// The best scene so far, and a few pictures beside their drawings. The fit goes on if this fails.
void FitJob::show_live(const Session& session, const vsplat::Fit& fit, const vsplat::Views& views) try {
  constexpr std::size_t most_pictures = 3;
  const double begun = elapsed_seconds();
  auto out = std::make_shared<LiveVersion>(LiveVersion{fit.scene(), page_, settings_, {}});
  std::vector<std::int32_t> shown = fit.views(VSPLAT_FIT_HELD_OUT);
  out->page.about_pictures =
      shown.empty() ? "None is held out: the scene is fitted to these." : "Held out: no step is fitted to them.";
  if (shown.empty()) shown = fit.views(VSPLAT_FIT_USED);
  vsplat_render_options drawing = VSPLAT_RENDER_OPTIONS_INIT;
  const vsplat_fit_result so_far = fit.result();
  std::copy(std::begin(so_far.background), std::end(so_far.background), drawing.background);
  const std::size_t rows = std::min(shown.size(), most_pictures);
  for (std::size_t row = 0; row < rows; ++row) {
    const auto view = static_cast<std::size_t>(shown[row * shown.size() / rows]);
    out->drawings.push_back(
        {views.name(view), fit.picture(view), vsplat::render(session.device(), out->scene, fit.camera(view), drawing)});
  }
  live_->show(std::move(out), begun);
} catch (const std::exception& e) {
  warn(std::string("the live page ends here: ") + e.what());
  live_.reset();
}

void FitJob::end_page(const Session& session, const vsplat::Scene& scene, Outputs& outputs, double begun) {
  const vsplat_fit_result& r = result_;
  const auto shown = [](double value, int digits, const char* unit = "") {
    char text[32];
    std::snprintf(text, sizeof text, "%.*f", digits, value);
    return std::isfinite(value) ? text + std::string(unit) : std::string(std::isinf(value) ? "equal" : "-");
  };
  page_.state = std::string(stopped_ ? "Stopped early" : "Finished") +
                (r.returned ? ": the start was best, and is written." : ".");
  page_.figures = {{"steps", std::to_string(r.steps)},
                   {"Gaussians", std::to_string(scene.info().count)},
                   {"time", seconds_text(elapsed_seconds() - since)},
                   {"device memory, at most", bytes_text(r.peak)}};
  if (r.num_held_out > 0)  // "PSNR held out" is of the scene that is written
    page_.figures.insert(page_.figures.end(),
                         {{"PSNR held out, start", shown(r.start_psnr, 2, " dB")},
                          {"PSNR held out", shown(r.returned ? r.start_psnr : r.result_psnr, 2, " dB")},
                          {"psnr_cc held out", shown(psnr_cc_, 2, " dB")},
                          {"SSIM held out", shown(r.returned ? r.start_ssim : r.result_ssim, 4)}});
  page_.after = elapsed_seconds() - begun - (page_.steps.empty() ? 0 : page_.steps.back().seconds);
  write_page(session, outputs);
}

// A row for each picture: given, start, result, difference.
void FitJob::draw_sheet(Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene, Outputs& outputs) const {
  std::vector<std::int32_t> shown = fit.views(VSPLAT_FIT_HELD_OUT);
  if (shown.empty()) shown = fit.views(VSPLAT_FIT_USED);
  const std::size_t rows = std::min(shown.size(), most_rows);
  vsplat_sheet_options how = VSPLAT_SHEET_OPTIONS_INIT;
  how.columns = 4;
  if (rows <= large_rows) how.cell = large_cell;
  const vsplat::Sheet sheet(how);
  vsplat_render_options drawing = VSPLAT_RENDER_OPTIONS_INIT;
  std::copy(std::begin(result_.background), std::end(result_.background), drawing.background);
  for (std::size_t row = 0; row < rows; ++row) {
    const auto view = static_cast<std::size_t>(shown[row * shown.size() / rows]);
    const vsplat_camera camera = fit.camera(view);
    vsplat::Sheet cells = sheet;
    vsplat::Picture given = fit.picture(view);
    cells.add(given);
    cells.add(vsplat::render(session.device(), start_, camera, drawing));
    const vsplat::Picture after = vsplat::render(session.device(), scene, camera, drawing);
    cells.add(after);
    std::transform(after.colour.begin(), after.colour.end(), given.colour.begin(), given.colour.begin(),
                   shown_difference);
    cells.add(given);
  }
  sheet.save(outputs.begin(sheet_));
}

std::vector<PageScene> FitJob::scenes(const std::string& start, const vsplat::Scene& result) const {
  if (result_.returned) return {{start, result}};
  return {{start, start_}, {"fitted", result}};
}

void FitJob::summarise(const Common& common) const {
  for (const std::string& name : outliers_)
    warn(name +
         " agrees with the result far less than the other pictures do: a wrong pose, another lighting, a moved "
         "object?");
  const vsplat_fit_result& r = result_;
  const std::string on =
      pictures_text(measured_on_.size()) + (r.in_turn ? ", each left out in turn: " : " that it was not fitted to: ");
  if (stopped_)
    tell_stop(common, "stopped; the best so far is written: " +
                          (r.returned ? std::string("the start") : "step " + std::to_string(r.steps)));
  if (r.num_held_out > 0 && std::isfinite(r.start_psnr) && std::isfinite(r.result_psnr)) {
    char text[128];
    std::snprintf(text, sizeof text, "PSNR %.2f to %.2f dB, SSIM %.4f to %.4f", r.start_psnr, r.result_psnr,
                  r.start_ssim, r.result_ssim);
    const std::string corrected =
        std::isfinite(psnr_cc_) ? ", " + decibels(psnr_cc_) + " after colour correction (psnr_cc)" : "";
    say(common, on + text + corrected + (r.returned ? "; the start is better, so it is what is written" : "") +
                    (r.claimed ? "" : "; the start may have seen these pictures, so no gain is claimed"));
    if (std::isfinite(r.sky_psnr) && !r.returned)
      say(common, "the sky is written as Gaussians: PSNR " + decibels(r.sky_psnr) + " before, " +
                      decibels(r.result_psnr) + " with them");
  } else if (r.returned) {
    say(common, "no picture could be held out to judge by: the start is what is written");
  } else {
    say(common, "nothing was held out: how good it is from elsewhere is unknown");
  }
}

void FitJob::add_results(ordered_json& out) const {
  const vsplat_fit_result& r = result_;
  const auto scores = [](double psnr, double ssim) {
    return ordered_json{{"psnr", number_json(psnr)}, {"ssim", number_json(ssim)}};
  };
  out["steps"] = r.steps;
  out["measured_on"] = measured_on_;
  out["start"] = scores(r.start_psnr, r.start_ssim);
  out["result"] = scores(r.result_psnr, r.result_ssim);
  out[r.returned ? "start" : "result"]["psnr_cc"] = number_json(psnr_cc_);
  if (std::isfinite(r.sky_psnr)) out["over_sky"] = scores(r.sky_psnr, r.sky_ssim);
  out["held_out"] = ordered_json::array();
  for (std::size_t i = 0; i < measured_; ++i)
    out["held_out"].push_back({{"name", page_.pictures[i].name},
                               {"psnr", number_json(page_.pictures[i].psnr)},
                               {"psnr_cc", number_json(page_.pictures[i].psnr_cc)},
                               {"ssim", number_json(page_.pictures[i].ssim)}});
  out["returned"] = r.returned ? "start" : "fitted";
  out["claimed"] = r.claimed != 0;
  out["outliers"] = outliers_;
  if (!log_.empty()) out["log"] = log_;
  if (!sheet_.empty()) out["sheet"] = sheet_;
  if (!poses_.empty()) out["poses"] = poses_;
  if (!page_path_.empty()) out["page"] = page_path_;
  if (!record_.empty()) out["settings"] = record_;
}

}  // namespace command
