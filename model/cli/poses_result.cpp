#include "poses_result.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace command {
namespace {

namespace fs = std::filesystem;

// Little-endian, as COLMAP writes on every machine.
template <class T>
bool read_value(std::ifstream& in, T& out) {
  return static_cast<bool>(in.read(reinterpret_cast<char*>(&out), sizeof out));
}

bool skip(std::ifstream& in, std::streamsize bytes) { return in.ignore(bytes) && in.gcount() == bytes; }

std::string after(const std::string& line, const char* before) {
  const std::size_t at = line.find(before);
  if (at == std::string::npos) return "";
  const std::size_t begin = line.find_first_not_of(' ', at + std::strlen(before));
  return begin == std::string::npos ? "" : line.substr(begin);
}

}  // namespace

std::vector<FoundModel> find_models(const fs::path& sparse) {
  std::vector<FoundModel> out;
  std::error_code error;
  for (fs::directory_iterator at(sparse, error), end; !error && at != end; at.increment(error)) {
    std::ifstream in(at->path() / "images.bin", std::ios::binary);
    FoundModel model{at->path()};
    if (read_value(in, model.pictures) && model.pictures > 0) out.push_back(model);
  }
  std::sort(out.begin(), out.end(), [](const FoundModel& a, const FoundModel& b) {
    return a.pictures != b.pictures ? a.pictures > b.pictures : a.folder < b.folder;
  });
  return out;
}

FoundPoints read_points(const fs::path& model) {
  constexpr std::streamsize id_position_colour = 8 + 3 * 8 + 3, observation = 4 + 4;
  const fs::path path = model / "points3D.bin";
  std::ifstream in(path, std::ios::binary);
  FoundPoints out;
  bool good = read_value(in, out.count);
  double sum = 0;
  for (std::uint64_t i = 0; i < out.count && good; ++i) {
    double error = 0;
    std::uint64_t observations = 0;
    good = skip(in, id_position_colour) && read_value(in, error) && read_value(in, observations) &&
           observations < (1U << 30) && skip(in, static_cast<std::streamsize>(observations) * observation);
    sum += error;
    if (error < 0) sum = -1e300;  // COLMAP has not computed it
  }
  if (!good) throw std::runtime_error(path.string() + ": COLMAP has written a damaged file of points");
  out.error = out.count == 0 || sum < 0 ? -1 : sum / static_cast<double>(out.count);
  return out;
}

std::map<std::string, std::uint64_t> features_in(const std::vector<fs::path>& logs) {
  std::map<std::string, std::uint64_t> out;
  for (const fs::path& log : logs) {
    std::ifstream in(log);
    std::string name;
    for (std::string line; std::getline(in, line);) {
      if (const std::string found = after(line, "  Name: "); !found.empty()) name = found;
      if (const std::string found = after(line, "  Features: "); !found.empty() && !name.empty())
        out[name] = std::strtoull(found.c_str(), nullptr, 10);
    }
  }
  return out;
}

}  // namespace command
