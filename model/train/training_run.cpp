#include "model/train/training_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "model/base/step_pace.h"
#include "model/io/picture/image_file.h"
#include "model/train/beginning.h"
#include "model/train/run_page.h"
#include "model/train/run_record.h"
#include "model/train/train_ranks.h"
#include "model/train/training_reading.h"
#include "model/train/training_sheet.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/profile/profiler.h"
#include "runtime/tuning/held_tuning.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

void refuse_unless_fits(const Context& ctx, const Trainer::Plan& plan) {
  if (plan.fits) return;
  fail(Status::memory,
       "not enough device memory for training: its network alone takes {:.3f} GiB of the {:.3f} GiB that may be used "
       "({}, {}, fewer views, a smaller model or another device; {} tells more){}",
       gib(plan.peak), gib(ctx.memory().limits().total), Option::max_memory, Option::train_assume_selected,
       Option::train_plan, plan.problem.empty() ? "" : "; " + plan.problem);
}

// log.csv: a line per progress report, up to the step that a continuation starts at.
class Log {
 public:
  Log(std::string path, long step) : path_(std::move(path)) {
    text_ = "step,seconds,lr,temperature,loss,psnr,psnr_coarse,selected,most_selected,intersections,gradient_norm\n";
    if (step == 0 || !fs::exists(path_)) return;
    const std::vector<unsigned char> bytes = read_file(path_);
    std::istringstream before(std::string(bytes.begin(), bytes.end()));
    std::string line;
    std::getline(before, line);
    while (std::getline(before, line)) {
      if (std::strtol(line.c_str(), nullptr, 10) > step) break;
      text_ += line + "\n";
      if (const auto comma = line.find(','); comma != std::string::npos)
        seconds_ = std::strtod(line.c_str() + comma + 1, nullptr);
    }
  }

  // Rewrites the whole file (some hundred kilobytes), so that it never ends with half a line.
  void add(const TrainProgress& p) {
    const StepReport& r = p.report;
    text_ += fmt::format("{},{:.1f},{:.6g},{:.4f},{:.6f},{:.3f},{:.3f},{:.5f},{},{},{:.5g}\n", r.step,
                         seconds_ + p.seconds, r.lr, r.temperature, r.loss, r.psnr, r.psnr_coarse, r.selected,
                         r.most_selected, r.intersections, r.gradient_norm);
    write_file(path_, text_.data(), text_.size());
  }

 private:
  std::string path_, text_;
  double seconds_ = 0;  // of earlier runs
};

// Accumulates reports of steps: counts are the maximum, step and rates the last value, others the mean. Also measures
// the pace.
class Telling {
 public:
  explicit Telling(long steps) : steps_(steps) {}

  void add(const StepReport& r, long compilations) {
    const StepReport before = sum_;
    pace_.add(seconds_since(stepped_), compilations);
    stepped_ = Clock::now();
    sum_ = r;
    sum_.loss += before.loss;
    sum_.psnr += before.psnr;
    sum_.psnr_coarse += before.psnr_coarse;
    sum_.selected += before.selected;
    sum_.gradient_norm += before.gradient_norm;
    sum_.most_selected = std::max(sum_.most_selected, before.most_selected);
    sum_.intersections = std::max(sum_.intersections, before.intersections);
    ++count_;
  }

  // Progress since the last call; each step has `objects` objects.
  TrainProgress take(std::size_t objects) {
    TrainProgress out;
    const double share = 1.0 / static_cast<double>(count_), pace = seconds_since(reported_) * share;
    reported_ = Clock::now();
    out.report = sum_;
    StepReport& r = out.report;
    for (double* value : {&r.loss, &r.psnr, &r.psnr_coarse, &r.selected, &r.gradient_norm}) *value *= share;
    out.steps = steps_;
    out.seconds = seconds_since(began_);
    out.objects_per_second = static_cast<double>(objects) / pace;
    if (const auto each = pace_.seconds()) out.seconds_left = *each * static_cast<double>(steps_ - r.step);
    sum_ = {};
    count_ = 0;
    return out;
  }

 private:
  long steps_;  // of the whole training
  StepReport sum_;
  long count_ = 0;
  const Clock::time_point began_ = Clock::now();
  Clock::time_point reported_ = began_, stepped_ = began_;
  StepPace pace_;
};

std::string duration_text(double seconds) {
  if (seconds < 100) return fmt::format("{:.2g} s", seconds);
  if (seconds < 2 * 3600) return fmt::format("{:.0f} minutes", seconds / 60);
  return seconds < 48 * 3600 ? fmt::format("{:.0f} hours", seconds / 3600)
                             : fmt::format("{:.0f} days", seconds / 86400);
}

// Messages before the first progress report: at steps 1, 2, 4, ... of this run, and a warning as soon as a step's
// duration shows that the run will take longer than a day.
class FirstSteps {
 public:
  FirstSteps(long step, long steps) : begun_(step), steps_(steps) {}

  // Call after each step; `reported`: progress was reported.
  void add(const StepReport& r, bool reported, const std::function<void(const std::string&)>& say) {
    const long done = r.step - begun_;
    const double took = seconds_since(last_), left = took * static_cast<double>(steps_ - r.step);
    last_ = Clock::now();
    ended_ = ended_ || reported;
    if (!ended_ && (done & (done - 1)) == 0)
      say(fmt::format("first steps: {} of {}, loss {:.4f}, {} for the last one{}", r.step, steps_, r.loss,
                      duration_text(took),
                      done == 1 ? ", which may have compiled" : ", about " + duration_text(left) + " left"));
    if (done == 2 && left > kDay)
      warn(
          "the {} steps that are left take about {} on this device, at {} a step: fewer steps, a smaller model (the "
          "configuration's model: small, tiny), fewer objects a step (batch) or another device take less",
          steps_ - r.step, duration_text(left), duration_text(took));
  }

 private:
  static constexpr double kDay = 86400;
  long begun_, steps_;
  bool ended_ = false;
  Clock::time_point last_ = Clock::now();
};

// Removes the remains of writes that a kill interrupted.
void remove_unfinished(const fs::path& folder) {
  std::error_code problem;
  std::vector<fs::path> found;
  for (auto it = fs::directory_iterator(folder, problem); !problem && it != fs::directory_iterator();
       it.increment(problem)) {
    const std::string name = it->path().filename().string();
    if (!name.ends_with(".tmp")) continue;
    for (const char* ours :
         {"checkpoint-", "config.json.", "log.csv.", "model.safetensors.", "record.json.", "report.html.", "step-"})
      if (name.starts_with(ours)) found.push_back(it->path());
  }
  for (const fs::path& path : found) fs::remove(path, problem);
}

std::string step_name(const char* what, long step, const char* suffix) {
  return fmt::format("{}-{:08d}{}", what, step, suffix);
}

// Draws a sheet and returns a message about it. Lack of memory is not an error: a sheet refines the network's selection
// and may not fit even if a step with given voxels does.
std::string draw_sheet(Context& ctx, const Network& network, const TrainingViews& views, double temperature,
                       long planned_selected, const std::string& path) {
  try {
    write_png(path, training_sheet(ctx, network, views, temperature, planned_selected));
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    return fmt::format("{} is left out: {}", path, e.what());
  }
  return "sheet " + path;
}

// The run's folder and its files.
class RunFolder {
 public:
  // Creates it, for a training that starts after `step` steps.
  RunFolder(const TrainConfig& config, const TrainOptions& options, long step)
      : config_(config), options_(options), folder_(options.output), saved_(step > 0 ? step : -1) {
    std::error_code problem;
    is_new_ = !fs::exists(folder_ / "config.json", problem) && fs::create_directories(folder_ / "sheets", problem);
    fs::create_directories(folder_ / "sheets", problem);
    if (problem) fail(Status::file, "{}: cannot be made: {}", options.output, problem.message());
    remove_unfinished(folder_);
    remove_unfinished(folder_ / "sheets");
    const std::string text = to_json(config);
    write_file((folder_ / "config.json").string(), text.data(), text.size());
    log_.emplace((folder_ / "log.csv").string(), step);
  }

  // Leaves nothing behind if the training failed before it produced a result.
  ~RunFolder() {
    std::error_code ignored;
    if (!is_new_ || fs::exists(folder_ / "log.csv", ignored) || saved_ >= 0) return;
    fs::remove(folder_ / "config.json", ignored);
    fs::remove(folder_ / "sheets", ignored);  // an empty one
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  void tell(const TrainProgress& progress) {
    log_->add(progress);
    if (options_.on_progress) options_.on_progress(progress);
  }

  void add_sheet(Context& ctx, const Trainer& trainer, const TrainingViews& views, double temperature) const {
    const std::string path = (folder_ / "sheets" / step_name("step", trainer.step(), ".png")).string();
    say(draw_sheet(ctx, *make_network(ctx, config_.model, trainer.weights()), views, temperature,
                   options_.planned_in_sheet, path));
  }

  // Writes the model for inference of an existing checkpoint: a kill may have come between the two files.
  void renew_model(const Checkpoint& found) {
    model_ = (folder_ / "model.safetensors").string();
    save_model(model_, found);
  }

  // Writes a checkpoint and the model for inference, unless they exist already.
  void save(const Trainer& trainer) {
    if (saved_ == trainer.step()) return;
    const Checkpoint now = trainer.checkpoint();
    const std::string path = checkpoint_path(options_.output, now.step);
    save_checkpoint(path, now);
    prune_checkpoints(options_.output, config_.keep_checkpoints);
    renew_model(now);
    saved_ = now.step;
    say("checkpoint " + path);
  }

  void say(const std::string& text) const {
    if (options_.on_message) options_.on_message(text);
  }

  // Path of the last checkpoint; "" if there is none.
  std::string checkpoint() const { return saved_ < 0 ? "" : checkpoint_path(options_.output, saved_); }
  // Path that save() wrote; "" before.
  const std::string& model() const { return model_; }

 private:
  const TrainConfig& config_;
  const TrainOptions& options_;
  fs::path folder_;
  std::optional<Log> log_;
  bool is_new_ = false;  // the folder held no run before
  long saved_;           // step of the last checkpoint; -1: none
  std::string model_;
};

// Minimum seconds between two pages: after a new sheet or checkpoint, and after a line of the log.
constexpr double kPageAfterFile = 10, kPageAfterLine = 600;

// Writes the run page and its record from time to time, using at most a twentieth of the training's time. If they
// cannot be written, the training continues without them.
class Page {
 public:
  Page(const Context& ctx, const DataSet& data, const TrainOptions& options, long step)
      : ctx_(ctx),
        path_((fs::path(run_of(options)) / "report.html").string()),
        run_(run_of(options)),
        start_(step),
        record_((fs::path(options.output) / "record.json").string(), step, part_of(ctx)) {
    record_.set_data(data, options.textures);
    if (run_ == options.output) return;
    remove_unfinished(run_);
  }

  // Renews the page after a step, unless the last one is less than `seconds` old. The first is always written.
  void renew(long step, int bad, double seconds) {
    if (made_ && seconds_since(*made_) < std::max(seconds, 19 * took_)) return;
    const Clock::time_point begun = Clock::now();
    write(step, bad);
    made_ = Clock::now();
    took_ = seconds_since(begun);
  }

  // Returns whether the page is up to date.
  bool write(long step, int bad) {
    record_.reach(step, seconds_since(began_), ctx_.memory().peak(), bad);
    try {
      if (step > start_) record_.write();
      write_report({run_}, path_);
      return true;
    } catch (const Error& e) {
      tell(e.what());
    } catch (const std::bad_alloc&) {
      tell(path_ + ": not enough host memory to make it");
    }
    return false;
  }

  const std::string& path() const { return path_; }

 private:
  static std::string run_of(const TrainOptions& options) { return options.run.empty() ? options.output : options.run; }

  static RunRecord::Part part_of(const Context& ctx) {
    RunRecord::Part out;
    out.device = ctx.device().name;
    out.driver = ctx.device().platform_name + " " + ctx.device().driver;
    out.kernels = name_of(ctx.flavour());
    out.tuning = ctx.tuning().hash();
    out.switched_off = switched_off_of(ctx);
    out.limit = ctx.memory().limits().total;
    return out;
  }

  // Warns once per problem, not at each attempt.
  void tell(const std::string& problem) {
    if (problem != warned_) warn("{}; the training goes on without it", problem);
    warned_ = problem;
  }

  const Context& ctx_;
  std::string path_, run_, warned_;
  long start_;  // steps done by earlier runs
  RunRecord record_;
  const Clock::time_point began_ = Clock::now();
  std::optional<Clock::time_point> made_;
  double took_ = 0;  // seconds
};

// One step on these objects. An error names the last valid checkpoint.
StepReport step(Trainer& trainer, const std::vector<TrainingViews>& views,
                const std::optional<std::vector<int>>& selection, const RunFolder& folder) {
  std::vector<StepItem> items;
  for (const TrainingViews& v : views) {
    items.push_back({&v});
    if (selection) items.back().selection = &*selection;
  }
  try {
    return trainer.step(items);
  } catch (const Error& e) {
    if (folder.checkpoint().empty()) throw;
    fail(e.status(), "{}; the last good checkpoint is {}", e.what(), folder.checkpoint());
  }
}

std::string going_on(const TrainConfig& config, long step) {
  const long all = total_steps(config.schedule);
  if (step < all) return fmt::format("going on from step {}", step);
  return fmt::format("all {} steps are done; {} continues after them", all, Option::extend);
}

// Whether an action is due that happens every `period` steps and after the last.
bool is_due(long period, long step, long steps) { return step == steps || (period > 0 && step % period == 0); }

}  // namespace

TrainResult train(Context& ctx, const TrainConfig& given, const DataSet& data, const TrainOptions& options) {
  // Checked before random weights are made, since a large model may exceed host memory; a file's weights are no larger
  // than the file.
  if (options.init.empty())
    refuse_unless_fits(
        ctx, plan_train(ctx, given, {options.selection, options.planned_selected, options.assumed_intersections}));
  const Beginning beginning = begin(given, {options.output, options.init, options.resume, options.extend});
  const Checkpoint& start = beginning.checkpoint;
  if (start.step > 0) refuse_other_tuning(ctx, start.state, options.output);
  const TrainConfig& config = start.config;
  const std::optional<std::vector<int>> selection = forced_selection(config, options.selection);
  if (!options.helpers.empty() && config.parts == 1)
    fail(Status::usage,
         "{}: {} devices share the parts of a step, but the configuration's parts is 1: 2 to {} (batch x accumulate) "
         "expected",
         Option::train_devices, options.helpers.size() + 1, config.batch * config.accumulate);
  if (options.leader) options.leader->begin(start);
  Trainer trainer(ctx, start, planned_of(selection, options.planned_selected), options.helpers,
                  options.leader ? &options.leader->ranks() : nullptr);
  refuse_unless_fits(ctx, trainer.plan(options.assumed_intersections));
  TrainingOptions own = training_reading(config, options);
  const auto [first, last] = trainer.own_objects();
  own.first_item = static_cast<int>(first), own.last_item = static_cast<int>(last);
  TrainingReader reader(data, own);
  // Other ranks' objects are not read.
  const auto views_of = [&](long step) {
    std::vector<TrainingViews> views(static_cast<std::size_t>(config.batch * config.accumulate));
    for (int i = own.first_item; i < own.last_item; ++i) views[static_cast<std::size_t>(i)] = reader.at(step, i);
    return views;
  };
  const long steps = total_steps(config.schedule);
  std::vector<TrainingViews> views;
  // Read before the folder is created, so that unreadable data leave no folder.
  if (trainer.step() < steps) views = views_of(trainer.step());
  RunFolder folder(config, options, start.step);
  for (const std::string& text : unfinished(config.schedule)) warn("{}", text);
  if (!beginning.note.empty()) folder.say(beginning.note);
  if (start.step > 0) {
    folder.renew_model(start);
    folder.say(going_on(config, start.step));
  }

  Page page(ctx, data, options, start.step);
  TrainResult result;
  Telling telling(steps);
  FirstSteps first_steps(start.step, steps);
  const auto go_through = [&] {
    while (trainer.step() < steps && !result.stopped) {
      if (views.empty()) views = views_of(trainer.step());
      if (options.leader) options.leader->begin_step();
      const StepReport report = step(trainer, views, selection, folder);
      if (options.leader) options.leader->give_moved(trainer.moved(), trainer.kinds());
      telling.add(report, ctx.profiler().compilations());
      const bool stop = options.stop && options.stop();
      const bool logs = is_due(config.log_every, report.step, steps) || stop;
      const bool draws = config.sheet_every > 0 && is_due(config.sheet_every, report.step, steps);
      const bool saves = is_due(config.checkpoint_every, report.step, steps) || stop;
      first_steps.add(report, logs, [&](const std::string& text) { folder.say(text); });
      if (logs) folder.tell(telling.take(views.size()));
      if (draws) folder.add_sheet(ctx, trainer, views.front(), report.temperature);
      if (saves) folder.save(trainer);
      if (logs || draws || saves)
        page.renew(report.step, reader.bad(), draws || saves ? kPageAfterFile : kPageAfterLine);
      result.stopped = stop && report.step < steps;
      views.clear();
    }
  };
  bool cancelled = false;
  try {
    go_through();
  } catch (const Error& e) {
    if (e.status() != Status::cancelled) throw;
    cancelled = true;  // a step updates all weights or none
    folder.say(fmt::format("stopped on request after step {}; its checkpoint is written", trainer.step()));
    ctx.go_on();
  }
  if (options.leader) options.leader->rest();
  const Uncancelled whole(ctx);  // further requests to stop wait for the same checkpoint
  folder.save(trainer);
  if (page.write(trainer.step(), reader.bad())) folder.say("report " + page.path());
  if (cancelled)
    fail(Status::cancelled, "stopped on request after step {}: its checkpoint is {}", trainer.step(),
         folder.checkpoint());
  result.step = trainer.step();
  result.model = folder.model();
  result.bad = reader.bad();
  result.peak = ctx.memory().peak();
  return result;
}

Trainer::Plan plan_train(const Context& ctx, const TrainConfig& config, const TrainPlanOptions& options) {
  const auto planner = ctx.planner();
  Checkpoint start;  // no weights: a plan needs no values, and a model's may exceed host memory
  start.config = config;
  const Trainer trainer(*planner, start, planned_of(forced_selection(config, options.selection), options.selected));
  return options.bound ? trainer.bound() : trainer.plan(options.intersections);
}

void plan_step(const Context& ctx, const TrainConfig& config, const TrainPlanOptions& options) {
  const auto planner = ctx.planner();
  Checkpoint start;
  start.config = config;
  const Trainer trainer(*planner, start, planned_of(forced_selection(config, options.selection), options.selected));
  (void)trainer.plan(options.intersections);
  trainer.plan_optimizer();
}

}  // namespace vsplat
