#include "model/io/views/listed_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <numeric>
#include <utility>

#include "model/io/any_case.h"
#include "model/io/reader/percent.h"
#include "model/io/views/unicode_form.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr int most_looked_through = 20000;  // files searched for an error message
constexpr int deepest_looked = 4;
constexpr std::size_t longest_name = 4096;  // no file has a longer path
constexpr std::size_t most_tails = 40;      // parts of a path, from its end, that are tried

bool is_regular(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// Endings of picture formats that are not read. Whoever converted such pictures may not have updated the list.
bool has_foreign_ending(const fs::path& file) {
  static constexpr std::array known = {".heic", ".heif", ".avif", ".jxl", ".jp2", ".gif", ".tga", ".dds",
                                       ".psd",  ".hdr",  ".pgm",  ".ppm", ".dng", ".cr2", ".cr3", ".nef",
                                       ".arw",  ".orf",  ".raf",  ".rw2", ".raw", ".ktx", ".ktx2"};
  const std::string ending = lower_case(file.extension().string());
  return std::find(known.begin(), known.end(), ending) != known.end();
}

// The name without a picture's ending. A dot in a name without such an ending has no special meaning.
std::string picture_stem(const fs::path& file) {
  return (has_picture_ending(file) || has_foreign_ending(file) ? file.stem() : file.filename()).string();
}

// The path and its ever shorter ends, longest first: the parts of it that may exist below a folder.
std::vector<fs::path> tails_of(const fs::path& name) {
  std::vector<fs::path> parts;
  for (const fs::path& part : name.lexically_normal().relative_path())
    if (part == "..")
      parts.clear();
    else if (!part.empty() && part != ".")
      parts.push_back(part);
  if (!parts.empty() && parts.front().string().size() == 2 && parts.front().string()[1] == ':')
    parts.erase(parts.begin());  // a drive
  if (parts.size() > most_tails) parts.erase(parts.begin(), parts.end() - static_cast<std::ptrdiff_t>(most_tails));
  std::vector<fs::path> out;
  for (std::size_t first = 0; first < parts.size(); ++first) {
    fs::path tail;
    for (std::size_t i = first; i < parts.size(); ++i) tail /= parts[i];
    out.push_back(std::move(tail));
  }
  return out;
}

std::string slashed(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

// Without blanks and line ends around it.
std::string trimmed(const std::string& name) {
  constexpr const char* blanks = " \t\r\n";
  const std::size_t first = name.find_first_not_of(blanks);
  return first == std::string::npos ? "" : name.substr(first, name.find_last_not_of(blanks) + 1 - first);
}

std::size_t letters_apart(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 1; j <= b.size(); ++j)
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])}));
  }
  return row[b.size()];
}

// The numbers in a name, without leading zeros.
std::vector<std::string> numbers_in(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] < '0' || text[i] > '9') continue;
    if (i == 0 || text[i - 1] < '0' || text[i - 1] > '9') out.emplace_back();
    if (text[i] != '0' || !out.back().empty()) out.back() += text[i];
  }
  return out;
}

// Whether one name may have been meant as the other: equal numbers, or nearly equal letters.
bool is_near(const std::string& a, const std::string& b, std::size_t apart) {
  const std::vector<std::string> numbers = numbers_in(a);
  if (numbers != numbers_in(b)) return false;
  return !numbers.empty() || apart <= std::max<std::size_t>(1, a.size() / 4);
}

// Without a picture's ending, in any case and form.
std::string plain(const fs::path& name) { return folded(picture_stem(name)); }

// At most three pictures in or below the folder with names similar to the listed one, the most similar first.
std::vector<std::string> near_names(const fs::path& folder, const fs::path& listed) {
  std::vector<std::pair<std::size_t, std::string>> near;
  const std::string wanted = plain(listed.filename());
  std::vector<std::string> out;
  if (wanted.size() > 255) return out;
  std::error_code error;
  int seen = 0;
  for (fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied, error), end;
       !error && at != end && seen < most_looked_through; at.increment(error), ++seen) {
    const std::string name = at->path().filename().string();
    if (name.front() == '.' || at.depth() >= deepest_looked) at.disable_recursion_pending();
    if (name.front() == '.' || !has_picture_ending(at->path())) continue;
    const std::string own = plain(name);
    if (own.size() > 255) continue;
    const std::size_t apart = letters_apart(wanted, own);
    if (is_near(wanted, own, apart)) near.emplace_back(apart, at->path().string());
  }
  std::sort(near.begin(), near.end());
  if (near.size() > 3) near.resize(3);
  for (auto& [apart, path] : near) out.push_back(printable(path));
  return out;
}

}  // namespace

bool has_picture_ending(const fs::path& file) {
  const std::string ending = lower_case(file.extension().string());
  static constexpr std::array known = {".png", ".jpg", ".jpeg", ".jpe",  ".jfif",
                                       ".exr", ".tif", ".tiff", ".webp", ".bmp"};
  return std::find(known.begin(), known.end(), ending) != known.end();
}

ListedFiles::ListedFiles(std::vector<fs::path> folders, std::optional<fs::path> written_from, Roots* roots)
    : folders_(std::move(folders)), written_from_(std::move(written_from)), roots_(roots) {}

const ListedFiles::Folder& ListedFiles::list(const fs::path& folder) {
  const auto known = listed_.find(folder);
  if (known != listed_.end()) return known->second;
  Folder& out = listed_[folder];
  std::error_code error;
  for (fs::directory_iterator at(folder.empty() ? "." : folder, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    out.by_folded_name.emplace(folded(name), name);
    if (has_picture_ending(name)) out.by_folded_stem.emplace(folded(at->path().stem().string()), name);
  }
  return out;
}

void ListedFiles::add_in_any_form(const fs::path& folder, const fs::path& below, fs::path::const_iterator part,
                                  fs::path::const_iterator end, std::vector<std::string>& out) {
  const fs::path here = below.empty() ? folder : folder / below;
  const auto add = [&](const std::string& name) {
    std::error_code error;
    if (std::next(part) == end) {
      if (is_regular(here / name)) out.push_back((below / name).string());
    } else if (fs::is_directory(here / name, error)) {
      add_in_any_form(folder, below / name, std::next(part), end, out);
    }
  };
  const std::string listed = part->string(), form = composed(listed);
  add(listed);
  if (is_ascii(listed) || (roots_ && !roots_->hold(here / listed))) return;
  const auto [first, last] = list(here).by_folded_name.equal_range(folded(listed));
  for (auto at = first; at != last; ++at)
    if (at->second != listed && composed(at->second) == form) add(at->second);
}

FoundFile ListedFiles::in_any_form(const fs::path& folder, const fs::path& path) {
  if (is_regular(folder / path)) return {folder / path, true};
  if (path.empty() || is_ascii(path.string())) return {};
  std::vector<std::string> found;
  add_in_any_form(folder, {}, path.begin(), path.end(), found);
  return {only_one(folder, found, path), false};
}

fs::path ListedFiles::folder_below(const fs::path& folder, const fs::path& path) {
  fs::path out = folder;
  std::error_code error;
  for (const fs::path& part : path) {
    if (fs::is_directory(out / part, error)) {
      out /= part;
      continue;
    }
    const auto [first, last] = list(out).by_folded_name.equal_range(folded(part.string()));
    if (first == last || std::next(first) != last) return {};
    out /= first->second;
    if (!fs::is_directory(out, error)) return {};
  }
  return out;
}

fs::path ListedFiles::only_one(const fs::path& folder, std::vector<std::string> names, const fs::path& listed) {
  std::erase_if(names, [&](const std::string& name) { return !is_regular(folder / name); });
  if (names.empty()) return {};
  std::sort(names.begin(), names.end());
  if (names.size() > 1) {
    const bool alike = composed(names[0]) == composed(names[1]);
    fail(Status::input,
         "{}: {} and {} both match {}, which is not there as listed{}: keep one of them, or list its exact name",
         folder.empty() ? "." : folder.string(), printable(names[0]), printable(names[1]), printable(listed.string()),
         alike ? " (the two differ in their Unicode form only, that is, in how accents are written)" : "");
  }
  return folder / names.front();
}

// Also ignores the case of the tail's folders.
fs::path ListedFiles::nearly(const fs::path& folder, const fs::path& tail) {
  const fs::path place = folder_below(folder, tail.parent_path());
  if (place.empty() && !(folder.empty() && tail.parent_path().empty())) return {};
  const Folder& files = list(place);
  const std::string file = tail.filename().string(), stem = picture_stem(tail), form = composed(stem);
  std::vector<std::string> same, with_stem, in_case;
  for (auto [at, end] = files.by_folded_name.equal_range(folded(file)); at != end; ++at) same.push_back(at->second);
  if (const fs::path found = only_one(place, same, tail); !found.empty()) return found;
  for (auto [at, end] = files.by_folded_stem.equal_range(folded(stem)); at != end; ++at)
    (composed(fs::path(at->second).stem().string()) == form ? with_stem : in_case).push_back(at->second);
  if (const fs::path found = only_one(place, with_stem, tail); !found.empty()) return found;
  return only_one(place, in_case, tail);
}

FoundFile ListedFiles::find_slashed(const std::string& name) {
  const fs::path path = name;
  FoundFile written;
  if (written_from_) written = in_any_form(*written_from_ / path.root_path(), path.relative_path());
  if (!written.path.empty() && (!roots_ || roots_->hold(written.path))) return written;
  const std::vector<fs::path> tails = tails_of(path);
  for (const fs::path& tail : tails)
    for (const fs::path& folder : folders_)
      if (const FoundFile found = in_any_form(folder, tail); !found.path.empty())
        return {found.path, found.exactly && path.is_relative() && tail == tails.front()};
  for (const fs::path& tail : tails)
    for (const fs::path& folder : folders_)
      if (const fs::path found = nearly(folder, tail); !found.empty()) return {found, false};
  if (path.is_absolute() && is_regular(path)) return {path, true};
  return written;
}

FoundFile ListedFiles::find(const std::string& name) {
  FoundFile out = find_as(name);
  for (const std::string& other : {trimmed(name), percent_decoded(trimmed(name))})
    if (out.path.empty() && other != name) out = {find_as(other).path, false};
  return out;
}

fs::path ListedFiles::find_with_ending(const std::string& name) {
  const fs::path found = find(name).path;
  const std::string wanted = lower_case(fs::path(trimmed(name)).extension().string());
  return lower_case(found.extension().string()) == wanted ? found : "";
}

FoundFile ListedFiles::find_as(const std::string& name) {
  if (name.empty() || name.size() > longest_name || name.find('\0') != std::string::npos) return {};
  if (name.find('\\') == std::string::npos) return find_slashed(name);
  for (const fs::path& folder : folders_)
    if (is_regular(folder / name)) return {folder / name, true};
  return find_slashed(slashed(name));
}

std::string ListedFiles::where_looked(const std::string& name) {
  std::vector<std::string> places, near;
  std::error_code error;
  std::string other;  // a folder or special file of that name, which cannot be read
  for (const fs::path& folder : folders_) {
    if (!fs::is_directory(folder.empty() ? "." : folder, error)) continue;
    places.push_back(printable(folder.empty() ? "." : folder.string()));
    if (const fs::path there = folder / fs::path(slashed(name)).relative_path();
        !name.empty() && fs::exists(there, error) && !fs::is_regular_file(there, error))
      other = printable(there.string());
    for (std::string& path : near_names(folder.empty() ? "." : folder, slashed(name)))
      if (near.size() < 3 && std::find(near.begin(), near.end(), path) == near.end()) near.push_back(std::move(path));
  }
  std::string out =
      fmt::format("looked for {} in {}, also by the end of its path, with other endings and in other case",
                  printable(name), places.empty() ? "no folder" : fmt::format("{}", fmt::join(places, " and ")));
  if (!other.empty()) out += fmt::format("; {} is not a regular file", other);
  if (!near.empty()) out += fmt::format("; near it: {}", fmt::join(near, ", "));
  return out;
}

}  // namespace vsplat
