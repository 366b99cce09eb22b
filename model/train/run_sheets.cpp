#include "model/train/run_sheets.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <string_view>
#include <tuple>

#include "runtime/error.h"
#include "runtime/files/base64.h"
#include "runtime/files/file.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostBytes = std::uintmax_t{12} << 20;  // 16 MiB in base64
constexpr std::size_t kMostSheets = 400;

struct Found {
  std::size_t stage = 0;
  long step = 0;
  fs::path path;
  std::uintmax_t bytes = 0;
};

// "step-00000500.png" -> 500; -1 for another name.
long step_of(const std::string& name) {
  constexpr std::string_view first = "step-", last = ".png";
  if (!name.starts_with(first) || !name.ends_with(last) || name.size() <= first.size() + last.size()) return -1;
  const char* const end = name.data() + name.size() - last.size();
  long out = -1;
  const auto read = std::from_chars(name.data() + first.size(), end, out);
  return read.ec == std::errc() && read.ptr == end ? out : -1;
}

std::vector<Found> list(const std::vector<fs::path>& folders) {
  std::vector<Found> out;
  for (std::size_t stage = 0; stage < folders.size(); ++stage) {
    std::error_code problem;
    for (auto it = fs::directory_iterator(folders[stage] / "sheets", problem);
         !problem && it != fs::directory_iterator(); it.increment(problem)) {
      const long step = step_of(it->path().filename().string());
      std::error_code ignored;
      if (step < 0 || !fs::is_regular_file(it->symlink_status(ignored))) continue;
      const auto bytes = it->file_size(ignored);
      if (!ignored) out.push_back({stage, step, it->path(), bytes});
    }
  }
  std::sort(out.begin(), out.end(),
            [](const Found& a, const Found& b) { return std::tie(a.stage, a.step) < std::tie(b.stage, b.step); });
  return out;
}

// `count` of them, evenly spread and including the last.
std::vector<Found> spread(const std::vector<Found>& all, std::size_t count) {
  std::vector<Found> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(all[count == 1 ? all.size() - 1 : i * (all.size() - 1) / (count - 1)]);
  return out;
}

std::vector<Found> those_that_fit(const std::vector<Found>& all) {
  std::size_t count = std::min(all.size(), kMostSheets);
  for (;;) {
    std::vector<Found> out = spread(all, count);
    std::uintmax_t bytes = 0;
    for (const Found& sheet : out) bytes += std::min(sheet.bytes, kMostBytes + 1);
    if (bytes <= kMostBytes) return out;
    // Estimates how many fit, since their sizes are similar.
    const auto share = static_cast<double>(kMostBytes) / static_cast<double>(bytes);
    count = std::min(count - 1, static_cast<std::size_t>(static_cast<double>(count) * share));
  }
}

bool is_png(const std::vector<unsigned char>& bytes) {
  constexpr unsigned char begins[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  return bytes.size() > sizeof begins && std::equal(std::begin(begins), std::end(begins), bytes.begin());
}

}  // namespace

RunSheets read_run_sheets(const std::vector<fs::path>& folders) {
  const std::vector<Found> all = list(folders);
  RunSheets out;
  for (const Found& sheet : those_that_fit(all)) try {
      const std::vector<unsigned char> bytes = read_file(sheet.path.string());
      if (is_png(bytes) && bytes.size() <= kMostBytes) out.sheets.push_back({sheet.stage, sheet.step, base64(bytes)});
    } catch (const Error&) {  // deleted since it was listed, or unreadable: counted below
    }
  out.left_out = all.size() - out.sheets.size();
  return out;
}

}  // namespace vsplat
