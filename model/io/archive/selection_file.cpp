#include "model/io/archive/selection_file.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

std::string_view trimmed(std::string_view text) {
  text = text.substr(0, static_cast<std::size_t>(std::find(text.begin(), text.end(), '#') - text.begin()));
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

}  // namespace

std::vector<int> read_selection(const std::string& path, long voxels) {
  const std::vector<unsigned char> bytes = read_file(path);
  std::string_view rest(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::vector<int> out;
  for (long line = 1; !rest.empty(); ++line) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view word = trimmed(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (word.empty()) continue;
    int index = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), index);
    if (error != std::errc() || stop != word.data() + word.size() || index < 0 || index >= voxels)
      fail(Status::format, "{}, line {}: \"{}\" is not the index of one of {} voxels", path, line,
           printable(word.substr(0, 40)), voxels);
    if (!out.empty() && index <= out.back())
      fail(Status::format, "{}, line {}: voxel {} after {}: ascending indices expected", path, line, index, out.back());
    out.push_back(index);
  }
  return out;
}

void write_selection(const std::string& path, const std::vector<int>& selected) {
  std::string text = "# selected voxels: (i R + j) R + k, i along x\n";
  for (const int voxel : selected) text += std::to_string(voxel) + "\n";
  write_file(path, text.data(), text.size());
}

}  // namespace vsplat
