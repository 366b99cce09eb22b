#include "model/io/views/view_set.h"

#include <fmt/format.h>

#include "model/io/views/view_checks.h"
#include "model/io/views/view_files.h"
#include "model/io/views/view_list.h"
#include "runtime/fail.h"
#include "runtime/files/roots.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

void count_pictures(const ViewSet& set, const ReadOptions& options) {
  std::size_t missing = 0, good = 0;
  const ListedView* first = nullptr;
  for (const ListedView& view : set.views) {
    if (!view.problem.empty()) continue;
    ++good;
    if (!view.picture.empty()) continue;
    ++missing;
    if (!first) first = &view;
  }
  if (missing == 0) return;
  const std::string looked = set.looked_for.empty() ? "" : fmt::format(" ({})", set.looked_for);
  if (missing == good)
    fail(Status::input, "{}: none of the {} pictures in the list is there; the first is {}{}{}", set.source.string(),
         missing, printable(first->name), looked,
         options.pictures_dir.empty() ? fmt::format("; give their folder ({})", Option::pictures) : "");
  warn("{}: {} of {} listed frames have no picture and are skipped; the first is {}{}", set.source.string(), missing,
       set.views.size(), printable(first->name), looked);
}

// The list may be malicious: files outside the allowed folders are not read.
void refuse_outside(ViewSet& set, bool use_pictures, Roots& roots) {
  for (std::size_t i = 0; i < set.views.size(); ++i) {
    ListedView& view = set.views[i];
    const auto who = [&](const char* what) {
      return fmt::format("{}: frame {} ({}): its {}", set.source.string(), i, printable(view.name), what);
    };
    if (!use_pictures && !view.picture.empty() && !roots.hold(view.picture)) view.picture.clear();
    if (!view.picture.empty()) roots.need(view.picture, who("picture"));
    if (view.mask) roots.need(*view.mask, who("mask"));
  }
  if (std::error_code error; !fs::is_regular_file(set.points, error) || !roots.hold(set.points)) set.points.clear();
}

void note_missing_masks(ViewSet& set) {
  for (ListedView& view : set.views) {
    std::error_code error;
    if (view.picture.empty() || !view.mask || fs::is_regular_file(*view.mask, error)) continue;
    view.problem = fmt::format("{}: no such file; it is the mask of {}", view.mask->string(), printable(view.name));
    view.problem_status = Status::file;
    view.picture.clear();
  }
}

void check_all(ViewSet& set, BadViews bad) {
  const ListedView* first = nullptr;
  std::size_t count = 0;
  for (const ListedView& view : set.views) {
    if (view.problem.empty()) continue;
    if (!first) first = &view;
    ++count;
  }
  if (!first || bad == BadViews::keep) return;
  if (count == set.views.size()) need_good(*first);
  if (bad == BadViews::refuse)
    fail(first->problem_status, "{}; {} of {} views cannot be used, and {} leaves them out", first->problem, count,
         set.views.size(), Option::skip_bad_views);
  warn("{}: {} of {} views cannot be used and are left out; the first: {}", set.source.string(), count,
       set.views.size(), first->problem);
}

}  // namespace

ViewSet read_views(const fs::path& given, const ReadOptions& options) {
  if (std::error_code error; !options.pictures_dir.empty() && !fs::is_directory(options.pictures_dir, error))
    fail(Status::file, "{}: no such folder of pictures", options.pictures_dir.string());
  const fs::path path = given == "-" ? fs::path("/dev/stdin") : given;
  ViewSet set = read_view_list(path, options);
  // The files of a list from a pipe lie in the current folder, not in /dev.
  if (given == "-" || path.parent_path() == "/dev" || path.parent_path() == "/dev/fd") set.source = "-";
  Roots roots;
  std::error_code error;
  const fs::path beside = fs::is_directory(set.source, error) ? set.source : set.source.parent_path();
  roots.add(beside.empty() ? "." : beside);
  if (fs::is_directory(path, error)) roots.add(path);
  roots.add(options.pictures_dir);
  for (const fs::path& root : options.roots) roots.add(root);
  find_view_files(set, path, options, roots);
  for (const std::string& choice : set.choices) options.tell ? info("{}", choice) : verbose("{}", choice);
  refuse_outside(set, options.use_pictures, roots);
  set.leaves_out_bad = options.bad == BadViews::leave_out;
  if (set.leaves_out_bad && options.use_pictures) note_missing_masks(set);
  for (ListedView& view : set.views)
    if (view.problem.empty() && view.camera.width > 0 && view.camera.height > 0)
      noting_problems(view, [&] { resolve_intrinsics(view, view.camera.width, view.camera.height); });
  check_all(set, options.bad);
  if (options.need_pictures) count_pictures(set, options);
  return set;
}

bool holds_views(const fs::path& folder) { return has_view_list(folder); }

void need_good(const ListedView& view) {
  if (!view.problem.empty()) fail(view.problem_status, "{}", view.problem);
}

namespace {

// Adapts to a resized picture: the same aspect ratio within a pixel.
void scale_to(Camera& c, const std::string& where, int listed_width, int listed_height, int width, int height) {
  const double x = static_cast<double>(width) / listed_width, y = static_cast<double>(height) / listed_height;
  const bool resized = std::abs(y * listed_width - width) < 1 || std::abs(x * listed_height - height) < 1;
  if (!resized)
    fail(Status::input, "{}: the picture is {} x {} pixels, its camera is listed with {} x {}{}", where, width, height,
         listed_width, listed_height,
         listed_width == height && listed_height == width
             ? ": it fits only after turning; turn the picture"
             : ": it is not a resized picture either, since the shape differs");
  c.fx *= x, c.cx *= x, c.fy *= y, c.cy *= y;
}

}  // namespace

void resolve_intrinsics(ListedView& view, int width, int height) {
  Camera& c = view.camera;
  const std::string where = view.picture.empty() ? printable(view.name) : view.picture.string();
  if (width < 1 || height < 1 || width > max_picture_side || height > max_picture_side)
    fail(Status::input, "{}: a picture of {} x {} pixels is not possible", where, width, height);
  const int listed_width = c.width > 0 ? c.width : width, listed_height = c.height > 0 ? c.height : height;
  if (listed_width != width || listed_height != height) scale_to(c, where, listed_width, listed_height, width, height);
  c.width = width, c.height = height;
  if (std::isnan(c.fx)) {
    if (!std::isnan(view.angle_x)) c.fx = 0.5 * width / std::tan(0.5 * view.angle_x);
    if (!std::isnan(view.angle_y)) c.fy = 0.5 * height / std::tan(0.5 * view.angle_y);
    if (std::isnan(c.fx)) c.fx = c.fy;
    if (std::isnan(c.fy)) c.fy = c.fx;
  }
  if (std::isnan(c.cx)) c.cx = 0.5 * width;
  if (std::isnan(c.cy)) c.cy = 0.5 * height;
  check_intrinsics(where, c);
}

bool is_resolved(const ListedView& view) {
  const Camera& c = view.camera;
  return c.width > 0 && c.height > 0 && std::isfinite(c.fx) && std::isfinite(c.fy) && std::isfinite(c.cx) &&
         std::isfinite(c.cy);
}

}  // namespace vsplat
