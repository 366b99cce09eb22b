// Values of options, parsed strictly: a number is the whole word and finite. Each function throws UsageError naming the
// option.
#pragma once
#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace command {

// Whether it is a whole number without a sign.
bool is_digits(const std::string& text);

double number(const std::string& option, const std::string& text);
// A length or a distance: above zero, and within the range of the device's floats. `what` names it in the error.
double positive_number(const std::string& option, const std::string& text, const std::string& what);
// The same check for options that CLI11 parses.
CLI::Validator positive();
// Above 0 and up to 1; 0 if the option was not given.
double voxel_share(const std::string& option, const std::string& text);
// "5%" or "5" gives 0.05; 0 or more.
double percentage(const std::string& option, const std::string& text);
std::string share_text(double share);  // "0.25"
std::uint64_t seed_value(const std::string& option, const std::string& text);
std::array<double, 3> triple(const std::string& option, const std::string& text);  // "x,y,z"

struct Size {
  int width = 0, height = 0;
};
std::uint64_t samples(const std::string& option, const std::string& text);  // "1" to "8"; 0 for "auto" or an option not
                                                                            // given
Size picture_size(const std::string& option, const std::string& text);      // "640x480"

bool is_set(const double (&three)[3]);  // whether one of them is not 0
std::string lower_case(std::string text);

// Splits "a,b,c"; no part may be empty.
std::vector<std::string> list(const std::string& option, const std::string& text);

// "red", "#ff8000" or "r,g,b" with each from 0 to 1; sRGB-encoded. If `transparent` is given, the word "transparent" is
// accepted too, and sets it.
std::array<float, 3> colour(const std::string& option, const std::string& text, bool* transparent = nullptr);

// UsageError if the file name does not end like this, in lower or upper case; "" is no file. `reason` explains it in
// the error.
void need_ending(const std::string& option, const std::string& path, const std::string& ending,
                 const std::string& reason = "");

// Cameras to draw from: "orbit:N", "path:CAMERAS:N" (N after the last colon), or the path of a cameras file.
struct CameraChoice {
  int orbit = 0, path = 0;  // N of each, or 0
  std::string file;         // the cameras, or the path's key cameras; "" for an orbit
};
CameraChoice camera_choice(const std::string& option, const std::string& text);

// Turns "--center -1,2,3" into "--center=-1,2,3", since a value may begin with a minus.
std::vector<std::string> with_joined_numbers(const std::vector<std::string>& arguments);

// Replaces earlier names ("refine", "--fit") and other programs' names of options ("--out", "--iterations") by those of
// this command, and drops "--input" before an argument that is positional here. Options are replaced only where the
// sub-command lacks the foreign name and has its own.
std::vector<std::string> with_names_of_here(const CLI::App& app, const std::vector<std::string>& arguments);

// UsageError if an option stands where the value of the one before is expected: CLI11 would take it for the value. An
// option that may have a number ("--live") gets its default if another word follows.
std::vector<std::string> with_values(const CLI::App& app, const std::vector<std::string>& arguments);

// UsageError for an empty value: most likely a script's variable that is not set, which must not count as "not given".
void refuse_empty_values(const std::vector<std::string>& arguments);

// The nearest of `names` by spelling, or "" if none is near.
std::string nearest(const std::string& word, const std::vector<std::string>& names);

// Error text for unknown arguments, with the nearest option or sub-command; "" if there are none.
std::string unknown_text(const CLI::App& app);

}  // namespace command
