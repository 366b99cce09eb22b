#include "poses_job.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <stdexcept>
#include <system_error>
#include <vsplat/vsplat.hpp>

#include "external_program.h"
#include "outputs.h"
#include "poses_result.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace command {
namespace {

namespace fs = std::filesystem;
namespace sys = vsplat::sys;
using Json = nlohmann::ordered_json;

constexpr int usual_frames = 40;
constexpr std::size_t always_exhaustive = 50, usually_exhaustive = 200;  // pictures

std::string counted(std::uint64_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

// A step of several pictures, pairs or blocks, with its progress line.
class Step {
 public:
  Step(const Common& common, const std::string& name) : common_(common), name_(name), started_(elapsed_seconds()) {}
  void at(double done) const {
    const double spent = elapsed_seconds() - started_;
    std::string text = name_ + ": " + std::to_string(static_cast<int>(100 * done)) + " %, " + seconds_text(spent);
    if (done > 0.05 && done < 1) text += ", about " + seconds_text(spent * (1 - done) / done) + " left";
    show_progress(common_, text);
  }

 private:
  const Common& common_;
  std::string name_;
  double started_;
};

// The share that COLMAP names by "[3/48]", or by "[2/5, 3/5]" for a block of pairs; 0 if the line names none.
double share_in(const std::string& line, bool begins) {
  const std::size_t at = line.find('[');
  unsigned long a = 0, b = 0, c = 0, d = 0;
  if (at == std::string::npos) return 0;
  const int found = std::sscanf(line.c_str() + at, "[%lu/%lu, %lu/%lu]", &a, &b, &c, &d);
  if (found < 2 || a == 0 || b == 0) return 0;
  if (found == 4 && c > 0 && d > 0)
    return (static_cast<double>(a - 1) + static_cast<double>(c - 1) / static_cast<double>(d)) / static_cast<double>(b);
  return std::min(1.0, static_cast<double>(begins ? a - 1 : a) / static_cast<double>(b));
}

// The number in "Registering image #7 (8)", which newer versions write "(num_reg_frames=8)".
double registered_in(const std::string& line) {
  const std::size_t at = line.find("Registering image #");
  const std::size_t bracket = at == std::string::npos ? at : line.find('(', at);
  const std::size_t number = bracket == std::string::npos ? bracket : line.find_first_of("0123456789", bracket);
  return number == std::string::npos ? 0 : std::strtod(line.c_str() + number, nullptr);
}

// What the mapper prints where it has found no camera, in any version.
bool found_nothing(const std::string& text) {
  for (const char* said : {"initial image pair", "ailed to create sparse model", "ailed to create any sparse model",
                           "No images with matches", "could not reconstruct any model"})
    if (text.find(said) != std::string::npos) return true;
  return false;
}

// A vocabulary tree that COLMAP has downloaded before.
std::string downloaded_vocabulary() {
  std::error_code error;
  const fs::path cache = fs::path(environment_variable("HOME")) / ".cache" / "colmap";
  std::string out;
  for (fs::directory_iterator at(cache, error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().find("vocab_tree") != std::string::npos)
      out = std::max(out, at->path().string());
  return out;
}

bool has_nvidia_gpu() {
  std::error_code error;
  return fs::exists("/dev/nvidiactl", error) || fs::exists("/dev/dxg", error);
}

Json facts_of_file(const fs::path& path) {
  const auto facts = sys::facts_of(path);
  if (!facts) throw std::runtime_error(path.string() + ": cannot be read");
  return {path.filename().string(), facts->size, facts->changed, facts->changed_ns};
}

}  // namespace

PosesJob::PosesJob(const PosesOptions& o)
    : o_(o), source_(find_pictures(o.pictures)), colmap_(o.colmap), work_(o.output, o.common.overwrite) {
  const bool video = !source_.video.empty();
  if (o.frames != 0 && !video) throw UsageError("--frames applies to a video: " + o.pictures + " is none");
  if (o.mask_features && o.mask_command.empty() && source_.masks.empty())
    throw UsageError("--mask-features needs masks: --mask-command, or a folder masks/ beside images/");
  if (!o.vocabulary.empty() && !sys::facts_of(o.vocabulary)) throw std::runtime_error(o.vocabulary + ": no such file");
  if (video) find_ffmpeg(source_.video, o.frames == 0 ? usual_frames : o.frames);
  if (o.gpu == "on" && !colmap_.uses_cuda())
    throw UsageError("--gpu on: this COLMAP (" + colmap_.version() + ") is built without CUDA");
  gpu_ = o.gpu == "on" || (o.gpu == "auto" && colmap_.uses_cuda() && has_nvidia_gpu());
  if (!o.mask_command.empty()) source_.masks.clear();
  vocabulary_ = o.vocabulary.empty() ? downloaded_vocabulary() : o.vocabulary;
  if (o.matcher == "vocabulary" && vocabulary_.empty())
    throw UsageError("--matcher vocabulary needs --vocabulary FILE, a vocabulary tree for this version of COLMAP");
  if (!video) groups_ = group_by_lens(source_.folder, source_.names);
}

Json PosesJob::request() const {
  Json files = Json::array();
  if (!source_.video.empty()) files.push_back(facts_of_file(source_.video));
  for (const std::string& name : source_.names) files.push_back(facts_of_file(source_.folder / name));
  return {{"files", files},
          {"colmap", colmap_.version()},
          {"frames", o_.frames},
          {"matcher", o_.matcher},
          {"vocabulary", o_.vocabulary},
          {"lens", o_.lens},
          {"masks", source_.masks.string()},
          {"mask_command", o_.mask_command},
          {"mask_features", o_.mask_features}};
}

void PosesJob::place_pictures() {
  const fs::path folder = in_work("images");
  if (!work_.is_done("pictures")) {
    fs::remove_all(folder);
    fs::create_directory(folder);
    for (const std::string& name : source_.names) place_file(source_.folder / name, folder / name);
    if (!source_.video.empty())
      cut_frames(o_.common, source_.video, o_.frames == 0 ? usual_frames : o_.frames, work_.folder(), folder,
                 work_.new_log("ffmpeg"));
    work_.finish("pictures");
  }
  names_.clear();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    names_.push_back(entry.path().filename().string());
  std::sort(names_.begin(), names_.end());
}

// Masks are called after their pictures with .png appended, where both COLMAP and `vsplat fit` find them.
void PosesJob::make_masks() {
  const fs::path folder = in_work("masks");
  if (work_.is_done("masks") || (o_.mask_command.empty() && source_.masks.empty())) return;
  fs::create_directories(folder);
  if (!source_.masks.empty()) {
    for (const fs::directory_entry& entry : fs::directory_iterator(source_.masks))
      if (entry.is_regular_file() && !fs::exists(folder / entry.path().filename()))
        place_file(entry.path(), folder / entry.path().filename());
  } else {
    const Step step(o_.common, "masks");
    const fs::path unfinished = in_work("mask.png");
    for (std::size_t i = 0; i < names_.size(); ++i) {
      step.at(static_cast<double>(i) / static_cast<double>(names_.size()));
      const fs::path mask = folder / (names_[i] + ".png");
      if (fs::exists(mask)) continue;
      fs::remove(unfinished);
      make_mask(o_.mask_command, fs::absolute(in_work("images") / names_[i]), fs::absolute(unfinished),
                work_.new_log("mask"));
      fs::rename(unfinished, mask);
    }
    for (const fs::path& log : work_.logs("mask")) fs::remove(log);
  }
  work_.finish("masks");
}

void PosesJob::choose_settings() {
  if (groups_.empty()) groups_ = group_by_lens(in_work("images"), names_);
  camera_model_ = o_.lens == "fisheye" ? "OPENCV_FISHEYE" : o_.lens == "opencv" ? "OPENCV" : "SIMPLE_RADIAL";
  const std::size_t count = names_.size();
  if (o_.matcher != "auto") {
    matcher_ = o_.matcher == "exhaustive"   ? Matcher::exhaustive
               : o_.matcher == "sequential" ? Matcher::sequential
                                            : Matcher::vocabulary;
  } else if (count <= always_exhaustive || (source_.video.empty() && count < usually_exhaustive)) {
    matcher_ = Matcher::exhaustive;
  } else if (!source_.video.empty()) {
    matcher_ = Matcher::sequential;
  } else if (!vocabulary_.empty()) {
    matcher_ = Matcher::vocabulary;
  } else {
    matcher_ = is_numbered_series(names_) ? Matcher::sequential : Matcher::exhaustive;
    say(o_.common, counted(count, "picture") + " and no vocabulary tree (--vocabulary): " +
                       (matcher_ == Matcher::sequential
                            ? "each is compared with its neighbours by number (--matcher exhaustive compares all)"
                            : "all pairs are compared, which takes long"));
  }
}

void PosesJob::extract(const std::vector<std::string>& names, const ColmapOption& camera, std::size_t done) {
  const fs::path list = in_work("list.txt");
  std::string text;
  for (const std::string& name : names) text += name + "\n";
  write_text(list.string(), text);
  const Step step(o_.common, "features");
  std::vector<ColmapOption> options = {{{"database_path"}, in_work("database.db").string()},
                                       {{"image_path"}, in_work("images").string()},
                                       {{"image_list_path"}, list.string()},
                                       {{"ImageReader.camera_model"}, camera_model_},
                                       camera,
                                       {{"FeatureExtraction.use_gpu", "SiftExtraction.use_gpu"}, gpu_ ? "1" : "0"}};
  if (o_.mask_features) options.push_back({{"ImageReader.mask_path"}, in_work("masks").string()});
  colmap_.run("feature_extractor", options, work_.new_log("features"), [&](const std::string& line) {
    if (line.find("Processed file") == std::string::npos) return;
    const double part = share_in(line, false) * static_cast<double>(names.size());
    step.at((static_cast<double>(done) + part) / static_cast<double>(names_.size()));
  });
}

// First one picture of each lens, so that the cameras have the numbers 1, 2, ... in the order of the groups; then the
// others of each. So a run that goes on gives the rest the same cameras.
void PosesJob::find_features() {
  if (work_.is_done("features")) return;
  say(o_.common, "finding features in " + counted(names_.size(), "picture"));
  std::vector<std::string> first;
  for (const LensGroup& group : groups_) first.push_back(group.names.front());
  if (!work_.is_done("lenses")) {
    for (const char* name : {"database.db", "database.db-wal", "database.db-shm", "database.db-journal"})
      fs::remove(in_work(name));
    extract(first, {{"ImageReader.single_camera_per_image"}, "1"}, 0);
    work_.finish("lenses");
  }
  std::size_t done = first.size();
  for (std::size_t i = 0; i < groups_.size(); ++i) {
    const std::vector<std::string> rest(groups_[i].names.begin() + 1, groups_[i].names.end());
    if (!rest.empty()) extract(rest, {{"ImageReader.existing_camera_id"}, std::to_string(i + 1)}, done);
    done += rest.size();
  }
  work_.finish("features");
}

std::vector<ColmapOption> PosesJob::matcher_options() const {
  std::vector<ColmapOption> out = {
      {{"database_path"}, in_work("database.db").string()},
      {{"FeatureMatching.use_gpu", "SiftMatching.use_gpu"}, gpu_ ? "1" : "0"},
  };
  if (matcher_ == Matcher::exhaustive) {  // small blocks show progress, and are what an interrupted run keeps
    const std::size_t block = std::clamp<std::size_t>(names_.size() / 6, 10, 50);
    out.push_back({{"ExhaustiveMatching.block_size"}, std::to_string(block), false});
  } else if (matcher_ == Matcher::vocabulary) {
    out.push_back({{"VocabTreeMatching.vocab_tree_path"}, vocabulary_});
  } else if (!vocabulary_.empty()) {
    out.push_back({{"SequentialMatching.loop_detection"}, "1", false});
    out.push_back({{"SequentialMatching.vocab_tree_path"}, vocabulary_, false});
  } else {
    out.push_back({{"SequentialMatching.loop_detection"}, "0", false});
  }
  return out;
}

void PosesJob::match() {
  if (work_.is_done("matches")) return;
  const std::size_t count = names_.size();
  const char* name = "exhaustive_matcher";
  std::string what = "comparing all " + std::to_string(count * (count - 1) / 2) + " pairs of pictures";
  if (matcher_ == Matcher::sequential) {
    name = "sequential_matcher";
    what = "comparing each picture with those that follow it";
  } else if (matcher_ == Matcher::vocabulary) {
    name = "vocab_tree_matcher";
    what = "comparing each picture with those that " + vocabulary_ + " finds similar";
  }
  say(o_.common, what);
  const Step step(o_.common, "matches");
  colmap_.run(name, matcher_options(), work_.new_log("matches"), [&](const std::string& line) {
    if (const double done = share_in(line, true); done > 0) step.at(done);
  });
  work_.finish("matches");
}

void PosesJob::find_cameras() {
  say(o_.common, "finding the cameras");
  const fs::path sparse = in_work("sparse"), log = work_.new_log("cameras");
  fs::remove_all(sparse);
  fs::create_directory(sparse);
  const Step step(o_.common, "cameras");
  colmap_.run(
      "mapper",
      {{{"database_path"}, in_work("database.db").string()},
       {{"image_path"}, in_work("images").string()},
       {{"output_path"}, sparse.string()}},
      log,
      [&](const std::string& line) {
        if (const double found = registered_in(line); found > 0)
          step.at(std::min(1.0, found / static_cast<double>(names_.size())));
      },
      found_nothing);
  if (find_models(sparse).empty())
    throw std::runtime_error(
        "COLMAP found no camera: no two of the " + std::to_string(names_.size()) +
        " pictures show enough of the same. Photograph with more overlap (some 15 degrees between neighbours), sharp, "
        "and with texture in view (newspaper under a plain object)" +
        (o_.mask_features ? "; or leave out --mask-features" : "") + ". COLMAP's output: " + log.string());
}

Json PosesJob::put_in_place() {
  const std::vector<FoundModel> models = find_models(in_work("sparse"));
  const FoundPoints points = read_points(models.front().folder);
  const fs::path result = work_.result();
  fs::create_directories(result / "sparse");
  fs::rename(models.front().folder, result / "sparse" / "0");
  fs::rename(in_work("images"), result / "images");
  if (fs::exists(in_work("masks"))) fs::rename(in_work("masks"), result / "masks");
  vsplat_views_options later = VSPLAT_VIEWS_OPTIONS_INIT;
  later.check_later = 1;
  const vsplat::Views views = vsplat::Views::load(result.string(), later);  // what every other command reads
  std::set<std::string> found;
  for (std::size_t i = 0; i < views.size(); ++i) found.insert(views.name(i));
  const std::map<std::string, std::uint64_t> features = features_in(work_.logs("features"));
  Json missing = Json::array(), sizes = Json::array(), lenses = Json::array();
  for (const std::string& name : names_) {
    if (found.count(name) != 0) continue;
    const auto known = features.find(name);
    missing.push_back({{"name", name}, {"features", known == features.end() ? Json() : Json(known->second)}});
  }
  for (const FoundModel& model : models) sizes.push_back(model.pictures);
  for (const LensGroup& group : groups_)
    lenses.push_back(
        {{"lens", group.lens}, {"width", group.width}, {"height", group.height}, {"pictures", group.names.size()}});
  Json out = {{"output", o_.output},
              {"pictures", names_.size()},
              {"registered", found.size()},
              {"points", points.count},
              {"reprojection_error", points.error < 0 ? Json() : Json(points.error)},
              {"missing", missing},
              {"models", sizes},
              {"lenses", lenses},
              {"camera_model", camera_model_},
              {"matcher", matcher_ == Matcher::exhaustive   ? "exhaustive"
                          : matcher_ == Matcher::sequential ? "sequential"
                                                            : "vocabulary"},
              {"masks", fs::exists(result / "masks")},
              {"gpu", gpu_},
              {"colmap", colmap_.version()},
              {"seconds", elapsed_seconds()}};
  write_text((result / "poses.json").string(), out.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  work_.publish();
  return out;
}

void PosesJob::tell(const Json& result) const {
  const auto pictures = result["pictures"].get<std::size_t>(), registered = result["registered"].get<std::size_t>();
  char error[64] = "";
  if (!result["reprojection_error"].is_null())
    std::snprintf(error, sizeof error, ", mean reprojection error %.2f pixels",
                  result["reprojection_error"].get<double>());
  say(o_.common, o_.output + ": cameras of " + std::to_string(registered) + " of " + counted(pictures, "picture") +
                     ", " + counted(result["points"].get<std::uint64_t>(), "point") + error + ", " +
                     (groups_.size() == 1 ? "1 lens" : std::to_string(groups_.size()) + " lenses") + ", " +
                     seconds_text(result["seconds"].get<double>()));
  if (result["models"].size() > 1) {
    std::string sizes;
    for (const Json& size : result["models"]) sizes += (sizes.empty() ? "" : ", ") + size.dump();
    warn("COLMAP could not connect all pictures and made " + std::to_string(result["models"].size()) + " models, of " +
         sizes + " pictures: the largest is kept. Pictures from between their places connect them");
  }
  if (registered == pictures)
    return say(o_.common, "next: vsplat fit " + vsplat::shell_word(o_.output) + " --output scene.ply");
  constexpr std::size_t shown = 12;
  std::string names;
  for (std::size_t i = 0; i < result["missing"].size() && i < shown; ++i) {
    const Json& one = result["missing"][i];
    names += (i == 0 ? "" : ", ") + one["name"].get<std::string>();
    if (!one["features"].is_null()) names += " (" + counted(one["features"].get<std::uint64_t>(), "feature") + ")";
  }
  if (result["missing"].size() > shown) names += " and " + std::to_string(result["missing"].size() - shown) + " more";
  const std::string text = "without a camera: " + names +
                           ". They show too little of what the others show, or are blurred; few features mean that a "
                           "picture has hardly any texture";
  if (2 * registered < pictures)
    warn("fewer than half of the pictures have a camera, so a fit shows only a part. " + text);
  else
    say(o_.common, text);
  say(o_.common, "next: vsplat fit " + vsplat::shell_word(o_.output) + " --output scene.ply");
}

Json PosesJob::run() {
  sys::set_variable("QT_QPA_PLATFORM", "offscreen");  // COLMAP's commands need no screen
  if (colmap_.is_newer_than_tried())
    warn("COLMAP " + colmap_.version() + " is newer than the versions that were tried, 3.8 to 4");
  work_.open(o_.common, request());
  try {
    place_pictures();
    make_masks();
    choose_settings();
    say(o_.common, "COLMAP " + colmap_.version() + " on the " + (gpu_ ? "GPU" : "processor") + ": " +
                       counted(names_.size(), "picture") + " by " +
                       (groups_.size() == 1 ? "one lens" : std::to_string(groups_.size()) + " lenses") + ", model " +
                       camera_model_);
    find_features();
    match();
    find_cameras();
    const Json out = put_in_place();
    tell(out);
    return out;
  } catch (const Interrupted&) {
    throw std::runtime_error("stopped; what is finished is in " + work_.folder().string() +
                             ", and the same command goes on from there");
  }
}

}  // namespace command
