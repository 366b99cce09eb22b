#include "poses_pictures.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <system_error>
#include <tuple>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "external_program.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace command {
namespace {

namespace fs = std::filesystem;
namespace sys = vsplat::sys;

constexpr int frames_to_choose_from = 5;  // for each that is kept

bool has_ending(const fs::path& path, std::initializer_list<const char*> endings) {
  const std::string own = lower_case(path.extension().string());
  return std::any_of(endings.begin(), endings.end(), [&](const char* ending) { return own == ending; });
}
bool is_picture(const fs::path& path) {
  return path.filename().string().front() != '.' &&
         has_ending(path, {".jpg", ".jpeg", ".jfif", ".png", ".tif", ".tiff", ".bmp", ".webp"});
}
bool is_video(const fs::path& path) {
  return has_ending(path, {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi", ".mts", ".m2ts", ".mpg", ".mpeg", ".wmv",
                           ".3gp", ".ogv"});
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> out;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (is_picture(at->path()) && at->is_regular_file(error)) out.push_back(at->path().filename().string());
  std::sort(out.begin(), out.end());
  return out;
}

// COLMAP's list of pictures has one name a line and drops blanks about it.
void refuse_unlistable(const PictureSource& source) {
  const auto bad = [](const std::string& name) {
    return name.find_first_of("\r\n") != std::string::npos || name.front() == ' ';
  };
  const auto found = std::find_if(source.names.begin(), source.names.end(), bad);
  if (found != source.names.end())
    throw std::runtime_error((source.folder / *found).string() +
                             ": COLMAP cannot read a name with a line break, or one that begins with a blank");
}

// The duration in seconds that ffmpeg prints; 0 if it is unknown.
double duration_in(const std::string& text) {
  int hours = 0, minutes = 0;
  double seconds = 0;
  const std::size_t at = text.find("Duration: ");
  if (at == std::string::npos || std::sscanf(text.c_str() + at, "Duration: %d:%d:%lf", &hours, &minutes, &seconds) != 3)
    return 0;
  return 3600.0 * hours + 60.0 * minutes + seconds;
}

double time_in(const std::string& line) {
  int hours = 0, minutes = 0;
  double seconds = 0;
  const std::size_t at = line.find("time=");
  if (at == std::string::npos || std::sscanf(line.c_str() + at, "time=%d:%d:%lf", &hours, &minutes, &seconds) != 3)
    return 0;
  return 3600.0 * hours + 60.0 * minutes + seconds;
}

std::string with_replaced(std::string text, const std::string& what, const std::string& by) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
  return text;
}

std::string beginning_of(const fs::path& log) {
  std::error_code error;
  const sys::Handle file = sys::open_to_read(log, error);
  std::string out(1 << 16, '\0');
  out.resize(error ? 0 : sys::read_at(file, 0, out.data(), out.size(), error));
  return out;
}

}  // namespace

PictureSource find_pictures(const std::string& path) {
  std::error_code error;
  PictureSource out;
  if (!fs::exists(path, error)) throw std::runtime_error(path + ": no such file or folder");
  if (!fs::is_directory(path, error)) {
    if (is_video(path)) {
      out.video = path;
      return out;
    }
    throw std::runtime_error(path + ": a folder of pictures is expected, or a video (.mp4, .mov, .mkv, .webm, ...)");
  }
  for (const char* inside : {"", "images", "input"}) {
    out.folder = *inside ? fs::path(path) / inside : fs::path(path);
    out.names = names_in(out.folder);
    if (!out.names.empty()) break;
  }
  if (out.names.empty())
    throw std::runtime_error(path +
                             ": no pictures here, nor in images/ or input/ (.jpg, .png, .tif, .webp, .bmp); convert "
                             "others first, such as .heic and raw files");
  constexpr std::size_t least = 3;
  if (out.names.size() < least)
    throw std::runtime_error(out.folder.string() + ": " + std::to_string(out.names.size()) +
                             (out.names.size() == 1 ? " picture" : " pictures") +
                             "; cameras are found from three or more that show the same, better from twenty");
  refuse_unlistable(out);
  const bool inside = out.folder != fs::path(path);
  if (const fs::path masks = fs::path(path) / "masks"; inside && fs::is_directory(masks, error)) out.masks = masks;
  return out;
}

std::vector<LensGroup> group_by_lens(const fs::path& folder, const std::vector<std::string>& names) {
  std::map<std::tuple<std::string, std::int32_t, std::int32_t>, LensGroup> found;
  for (const std::string& name : names) {
    const std::string path = (folder / name).string();
    LensGroup own;
    vsplat::check(vsplat_picture_file_size(path.c_str(), &own.width, &own.height));
    char* lens = nullptr;
    vsplat::check(vsplat_picture_file_lens(path.c_str(), &lens));
    own.lens = vsplat::text(lens);
    LensGroup& group = found.try_emplace({own.lens, own.width, own.height}, own).first->second;
    group.names.push_back(name);
  }
  std::vector<LensGroup> out;
  out.reserve(found.size());
  for (auto& [key, group] : found) out.push_back(std::move(group));
  std::sort(out.begin(), out.end(),
            [](const LensGroup& a, const LensGroup& b) { return a.names.front() < b.names.front(); });
  return out;
}

bool is_numbered_series(const std::vector<std::string>& names) {
  const auto without_number = [](const std::string& name) {
    const std::string stem = fs::path(name).stem().string();
    const std::size_t end = stem.find_last_not_of("0123456789");
    return end == std::string::npos ? std::string() : stem.substr(0, end + 1);
  };
  return std::all_of(names.begin(), names.end(), [&](const std::string& name) {
    return std::isdigit(static_cast<unsigned char>(fs::path(name).stem().string().back())) != 0 &&
           without_number(name) == without_number(names.front());
  });
}

void place_file(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (!sys::link(fs::canonical(from), to)) return;
  fs::copy_file(from, to, error);
  if (error) throw std::runtime_error(to.string() + " cannot be written: " + error.message());
}

std::string find_ffmpeg(const fs::path& video, int count) {
  std::string out = find_program("ffmpeg");
  if (out.empty())
    throw std::runtime_error(
        video.string() +
        ": is a video, and ffmpeg, which cuts pictures from it, is not installed: apt install ffmpeg (Debian, Ubuntu), "
        "dnf install ffmpeg-free (Fedora), brew install ffmpeg (macOS). On another machine, some " +
        std::to_string(count) + " pictures are cut by\n  mkdir frames && ffmpeg -i " +
        vsplat::shell_word(video.filename().string()) +
        " -vf fps=2 -q:v 2 frames/%04d.jpg\nand then given as the folder frames");
  return out;
}

void cut_frames(const Common& common, const fs::path& video, int count, const fs::path& work, const fs::path& folder,
                const fs::path& log) {
  const std::string ffmpeg = find_ffmpeg(video, count), input = fs::absolute(video).string();
  const double duration = duration_in(output_of(ffmpeg, {"-hide_banner", "-nostdin", "-i", input}, 60).text);
  const double started = elapsed_seconds();
  constexpr double usual_rate = 8;  // frames a second, where the duration is unknown
  const double rate = duration > 0 ? frames_to_choose_from * count / duration : usual_rate;
  const fs::path all = work / "frames";
  fs::remove_all(all);
  fs::create_directories(all);
  // At one quantiser the sharper of two neighbouring frames needs more bytes.
  const ProgramOutput end =
      run_logged(ffmpeg,
                 {"-hide_banner", "-nostdin", "-i", input, "-an", "-vf", "fps=" + std::to_string(rate), "-q:v", "2",
                  (all / "%06d.jpg").string()},
                 log, [&](const std::string& line) {
                   const double at = time_in(line);
                   if (at > 0 && duration > 0)
                     show_progress(common, "cutting the video: " + seconds_text(at) + " of " + seconds_text(duration) +
                                               ", " + seconds_text(elapsed_seconds() - started));
                 });
  const std::vector<std::string> frames = names_in(all);
  if (!end.how.empty() || frames.empty())
    throw std::runtime_error(video.string() + ": ffmpeg cut no pictures from it" +
                             (end.how.empty() ? "" : " (" + end.how + ")") +
                             "; its last lines:" + last_lines(end.text, 5) + "\nAll of them are in " + log.string());
  const std::size_t kept = std::min(frames.size(), static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < kept; ++i) {
    const std::size_t from = i * frames.size() / kept, to = (i + 1) * frames.size() / kept;
    fs::path best;
    for (std::size_t k = from; k < to; ++k)
      if (best.empty() || fs::file_size(all / frames[k]) > fs::file_size(best)) best = all / frames[k];
    char name[32];
    std::snprintf(name, sizeof name, "%04zu.jpg", i + 1);
    fs::rename(best, folder / name);
  }
  fs::remove_all(all);
}

void make_mask(const std::string& command, const fs::path& picture, const fs::path& mask, const fs::path& log) {
  const std::string shell = find_program("sh");
  if (shell.empty()) throw std::runtime_error("--mask-command needs a shell: PATH has no program sh");
  std::string line = with_replaced(with_replaced(command, "{picture}", "\"$1\""), "{mask}", "\"$2\"");
  if (line == command) line += " \"$1\" \"$2\"";
  const ProgramOutput end = run_logged(shell, {"-c", line, "sh", picture.string(), mask.string()}, log, [](auto&) {});
  const auto refuse = [&](const std::string& why) {
    const std::string said = beginning_of(log);
    throw std::runtime_error("--mask-command, for " + picture.string() + ": " + why +
                             (said.empty() ? "" : "; its last lines:" + last_lines(said, 5)));
  };
  if (!end.how.empty()) refuse(end.how);
  std::error_code error;
  if (!fs::is_regular_file(mask, error)) refuse("it ended without an error and wrote no " + mask.string());
  std::int32_t width = 0, height = 0, own_width = 0, own_height = 0;
  vsplat::check(vsplat_picture_file_size(picture.c_str(), &width, &height));
  if (vsplat_picture_file_size(mask.c_str(), &own_width, &own_height) != VSPLAT_OK)
    refuse(std::string("what it wrote is no picture: ") + vsplat_last_error());
  if (own_width != width || own_height != height)
    refuse("its mask has " + std::to_string(own_width) + " x " + std::to_string(own_height) +
           " pixels, the picture has " + std::to_string(width) + " x " + std::to_string(height) +
           (own_width == height && own_height == width
                ? ": the program has turned it as its EXIF orientation says; save the pictures upright before "
                  "(mogrify -auto-orient)"
                : ""));
}

}  // namespace command
