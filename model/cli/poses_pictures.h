// The pictures whose cameras are to be found: from a folder or cut from a video, grouped by the lens that took them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "command.h"

namespace command {

struct PictureSource {
  std::filesystem::path folder;    // of the pictures; empty for a video
  std::vector<std::string> names;  // in it, sorted
  std::filesystem::path masks;     // the folder of masks beside it, or empty
  std::filesystem::path video;     // empty for a folder
};

// `path`: a folder with pictures, or with a folder images/ or input/ of them, or a video. std::runtime_error for
// anything else.
PictureSource find_pictures(const std::string& path);

// Pictures of one size that one lens took, as far as their EXIF data say, share a camera.
struct LensGroup {
  std::string lens;  // as vsplat_picture_file_lens() names it
  std::int32_t width = 0, height = 0;
  std::vector<std::string> names;  // sorted
};
// In the order of their first names. Every file is opened: a damaged one is an error.
std::vector<LensGroup> group_by_lens(const std::filesystem::path& folder, const std::vector<std::string>& names);

// Whether the names differ only in a number, as those of a video's frames do.
bool is_numbered_series(const std::vector<std::string>& names);

// Makes a file with the same content: a second name of it, or a copy on another file system.
void place_file(const std::filesystem::path& from, const std::filesystem::path& to);

// Cuts `count` pictures from a video into a folder, evenly spread; of every few neighbours the sharpest. `work`: a
// folder for temporary files. Uses ffmpeg, which must be installed.
void cut_frames(const Common& common, const std::filesystem::path& video, int count, const std::filesystem::path& work,
                const std::filesystem::path& folder, const std::filesystem::path& log);
// std::runtime_error, with the command to use instead, if ffmpeg is not installed.
std::string find_ffmpeg(const std::filesystem::path& video, int count);

// Runs the user's program for one picture, which has to write a mask of the picture's shape.
void make_mask(const std::string& command, const std::filesystem::path& picture, const std::filesystem::path& mask,
               const std::filesystem::path& log);

}  // namespace command
