// Values of options, read strictly: a number is a whole word, finite, and nothing follows it. Each throws UsageError
// naming the option.
#pragma once
#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace command {

double number(const std::string& option, const std::string& text);
// A length or a distance: above zero, and within what the device's floats hold. `what` names it in the error.
double positive_number(const std::string& option, const std::string& text, const std::string& what);
// The same strictness for options that CLI11 reads.
CLI::Validator positive();
// Above 0 and up to 1; 0 where the option was not given.
double voxel_share(const std::string& option, const std::string& text);
// "5%" or "5": 0.05; 0 or more.
double percentage(const std::string& option, const std::string& text);
std::string share_text(double share);  // "0.25"
std::uint64_t seed_value(const std::string& option, const std::string& text);
std::array<double, 3> triple(const std::string& option, const std::string& text);  // "x,y,z"

struct Size {
  int width = 0, height = 0;
};
std::uint64_t samples(const std::string& option, const std::string& text);  // "1" to "8"; 0: "auto", or nothing given
Size picture_size(const std::string& option, const std::string& text);      // "640x480"

// "a,b,c" -> its parts, none empty.
std::vector<std::string> list(const std::string& option, const std::string& text);

// "red", "#ff8000" or "r,g,b" with each from 0 to 1; sRGB-encoded. With a `transparent`, that word, too, which sets it.
std::array<float, 3> colour(const std::string& option, const std::string& text, bool* transparent = nullptr);

// A file's name that must end so, in small or capital letters; "" is none. `reason` says why.
void need_ending(const std::string& option, const std::string& path, const std::string& ending,
                 const std::string& reason = "");

// Which cameras to draw from: "orbit:N", "path:CAMERAS:N" (N after the last colon), or the path of a cameras file.
struct CameraChoice {
  int orbit = 0, path = 0;  // their N, or 0
  std::string file;         // the cameras, or the path's keys; "" for an orbit
};
CameraChoice camera_choice(const std::string& option, const std::string& text);

// "--center -1,2,3" becomes "--center=-1,2,3": a value may begin with a minus.
std::vector<std::string> with_joined_numbers(const std::vector<std::string>& arguments);

// What other programs call an option ("--out", "--iterations") becomes what the sub-command calls it here, and
// "--input" before an argument that has no name here is left out: where the sub-command has no option of that name,
// and has the other one.
std::vector<std::string> with_names_of_here(const CLI::App& app, const std::vector<std::string>& arguments);

// Throws where a value is empty: most likely a script's variable that is not set, which must not pass for "not given".
void refuse_empty_values(const std::vector<std::string>& arguments);

// The nearest of `names` by spelling, or "" where none is near.
std::string nearest(const std::string& word, const std::vector<std::string>& names);

// What to say of arguments that nothing took, with the nearest option or sub-command; "" where there are none.
std::string unknown_text(const CLI::App& app);

}  // namespace command
