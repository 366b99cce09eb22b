#include "comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <utility>

#include "command.h"
#include "difference.h"

namespace command {
namespace {

std::string size_text(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

std::string number_text(double value, int digits) {
  if (std::isnan(value)) return "-";
  if (std::isinf(value)) return "equal";
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

nlohmann::ordered_json json_number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

std::string line_text(const std::string& name, double psnr, double psnr_cc, double ssim, const std::string& file) {
  char text[80];
  std::snprintf(text, sizeof text, "%-8s %9s %9s %8s  ", name.c_str(), number_text(psnr, 3).c_str(),
                number_text(psnr_cc, 3).c_str(), number_text(ssim, 5).c_str());
  const std::string line = text + file;
  return line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
}

}  // namespace

std::string index_text(std::size_t index) {
  char text[32];
  std::snprintf(text, sizeof text, "%04zu", index);
  return text;
}

std::string Comparison::difference_file(const std::string& folder, std::size_t index) {
  return (std::filesystem::path(folder) / (index_text(index) + ".png")).string();
}

Comparison::Comparison(std::string folder, std::string differences, const float (&background)[3], Shots shots,
                       Outputs& outputs, bool skip_bad)
    : folder_(std::move(folder)),
      differences_(std::move(differences)),
      shots_(std::move(shots)),
      skip_bad_(skip_bad),
      files_(shots_.all.size()) {
  std::copy(std::begin(background), std::end(background), background_);
  std::set<std::string> seen;
  for (std::size_t i = 0; i < shots_.all.size(); ++i) {
    try {
      files_[i] = find(i);
    } catch (const std::exception& e) {
      leave_out(i, e);
      continue;
    }
    if (!seen.insert(files_[i]).second)
      throw std::runtime_error("--compare " + folder_ + ": " + files_[i] +
                               " fits several cameras: give their pictures in the folders of the cameras' list");
    outputs.input(files_[i]);
  }
  if (seen.empty()) throw std::runtime_error("--compare " + folder_ + ": no picture of any camera can be used");
}

void Comparison::leave_out(std::size_t index, const std::exception& error) {
  const auto* const of_library = dynamic_cast<const vsplat::Error*>(&error);
  const bool is_about_picture = !of_library || of_library->status() == VSPLAT_ERROR_FILE ||
                                of_library->status() == VSPLAT_ERROR_FORMAT ||
                                of_library->status() == VSPLAT_ERROR_INPUT;
  if (!skip_bad_ || !is_about_picture) throw;
  warn("camera " + std::to_string(index) + " is left out of the comparison: " + error.what());
  files_[index].clear();
}

// Finds the file of camera `index` and checks that its size can be compared.
std::string Comparison::find(std::size_t index) const {
  const std::string file = shots_.listed.find_picture(index, folder_);
  if (file.empty())
    throw std::runtime_error("--compare " + folder_ + ": no picture for camera " + std::to_string(index) + " of " +
                             std::to_string(shots_.all.size()) +
                             ": looked below the folder for the path of its file in the cameras' list, the end of that "
                             "path, and its stem with another ending, or " +
                             index_text(index) + " if the list names no file; --skip-bad leaves such cameras out");
  int32_t width = 0, height = 0;
  shots_.listed.picture_size(index, file, width, height);
  const vsplat_camera& camera = shots_.all[index];
  const double scaled = static_cast<double>(height) * camera.width / width;
  if (width < camera.width || height < camera.height || std::abs(scaled - camera.height) > 1)
    throw std::runtime_error("--compare: " + file + " is " + size_text(width, height) + " pixels, camera " +
                             std::to_string(index) + " draws " + size_text(camera.width, camera.height) +
                             ": pictures of that size, or larger ones of its proportions, are expected; see --size");
  return file;
}

std::future<std::vector<float>> Comparison::load(std::size_t index) const {
  const vsplat_camera& camera = shots_.all[index];
  return std::async(std::launch::async, [listed = shots_.listed, file = files_[index], index, width = camera.width,
                                         height = camera.height, colour = std::to_array(background_)] {
    const float background[3] = {colour[0], colour[1], colour[2]};
    return listed.load_picture(index, file, width, height, background);
  });
}

std::string Comparison::add(std::size_t index, const vsplat::Picture& drawn, Outputs& outputs) {
  std::future<std::vector<float>> loading = std::move(next_);
  if (!files_[index].empty() && !loading.valid()) loading = load(index);
  const bool is_last = index + 1 == shots_.all.size();
  if (!is_last && !files_[index + 1].empty()) next_ = load(index + 1);
  std::vector<float> given;
  try {
    if (loading.valid()) given = loading.get();
  } catch (const std::exception& e) {
    leave_out(index, e);
  }
  if (!files_[index].empty()) compare(index, drawn, given, outputs);
  if (is_last && rows_.empty())
    throw std::runtime_error("--compare " + folder_ + ": no picture of any camera can be used");
  return files_[index].empty() ? "left out" : number_text(rows_.back().psnr, 1);
}

void Comparison::compare(std::size_t index, const vsplat::Picture& drawn, const std::vector<float>& given,
                         Outputs& outputs) {
  vsplat_comparison found = VSPLAT_COMPARISON_INIT;
  vsplat::check(vsplat_compare(drawn.colour.data(), given.data(), drawn.width, drawn.height, &found, nullptr));
  rows_.push_back({index, files_[index], found.psnr, found.psnr_cc, found.ssim});
  if (differences_.empty()) return;
  vsplat::Picture difference(drawn.width, drawn.height);
  std::transform(drawn.colour.begin(), drawn.colour.end(), given.begin(), difference.colour.begin(), shown_difference);
  difference.save(outputs.begin(difference_file(differences_, index)), VSPLAT_PICTURE_PNG);
}

Comparison::Row Comparison::mean() const {
  Row out;
  for (const Row& row : rows_) {
    out.psnr += row.psnr / static_cast<double>(rows_.size());
    out.psnr_cc += row.psnr_cc / static_cast<double>(rows_.size());
    out.ssim += row.ssim / static_cast<double>(rows_.size());
  }
  return out;
}

std::string Comparison::table() const {
  char head[80];
  std::snprintf(head, sizeof head, "%-8s %9s %9s %8s  ", "picture", "PSNR, dB", "psnr_cc", "SSIM");
  std::string out = head + std::string("against\n");
  for (const Row& row : rows_) out += line_text(index_text(row.index), row.psnr, row.psnr_cc, row.ssim, row.file);
  const Row all = mean();
  out += line_text("mean", all.psnr, all.psnr_cc, all.ssim, "");
  out.pop_back();
  return out;
}

nlohmann::ordered_json Comparison::json() const {
  nlohmann::ordered_json pictures = nlohmann::ordered_json::array();
  for (const Row& of : rows_) {
    nlohmann::ordered_json row = {{"reference", of.file},
                                  {"psnr", json_number(of.psnr)},
                                  {"psnr_cc", json_number(of.psnr_cc)},
                                  {"ssim", json_number(of.ssim)}};
    if (!differences_.empty()) row["difference"] = difference_file(differences_, of.index);
    pictures.push_back(std::move(row));
  }
  const Row all = mean();
  nlohmann::ordered_json out = {{"psnr", json_number(all.psnr)},
                                {"psnr_cc", json_number(all.psnr_cc)},
                                {"ssim", json_number(all.ssim)},
                                {"pictures", pictures}};
  if (rows_.size() < files_.size()) out["left_out"] = files_.size() - rows_.size();
  return out;
}

}  // namespace command
