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

namespace command {
namespace {

constexpr float difference_gain = 4;  // at 1, what an eye sees in the pictures is black in their difference

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

std::string line_text(const std::string& name, double psnr, double ssim, const std::string& file) {
  char text[64];
  std::snprintf(text, sizeof text, "%-8s %9s %8s  ", name.c_str(), number_text(psnr, 3).c_str(),
                number_text(ssim, 5).c_str());
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
                       Outputs& outputs)
    : folder_(std::move(folder)), differences_(std::move(differences)), shots_(std::move(shots)) {
  std::copy(std::begin(background), std::end(background), background_);
  std::set<std::string> seen;
  for (std::size_t i = 0; i < shots_.all.size(); ++i) {
    const std::string file = shots_.listed.find_picture(i, folder_);
    if (file.empty())
      throw std::runtime_error("--compare " + folder_ + ": no picture (PNG, JPEG, EXR) for camera " +
                               std::to_string(i) + " of " + std::to_string(shots_.all.size()) +
                               ": the stem of its file in the cameras' list is looked for, or " + index_text(i) +
                               " where the list names none");
    if (!seen.insert(file).second)
      throw std::runtime_error("--compare " + folder_ + ": " + file +
                               " fits several cameras: give their pictures in the folders of the cameras' list");
    int32_t width = 0, height = 0;
    vsplat::check(vsplat_picture_file_size(file.c_str(), &width, &height));
    const vsplat_camera& camera = shots_.all[i];
    const double scaled = static_cast<double>(height) * camera.width / width;
    if (width < camera.width || height < camera.height || std::abs(scaled - camera.height) > 1)
      throw std::runtime_error("--compare: " + file + " is " + size_text(width, height) + " pixels, camera " +
                               std::to_string(i) + " draws " + size_text(camera.width, camera.height) +
                               ": pictures of that size or larger ones of its proportions are expected; --size");
    outputs.input(file);
    files_.push_back(file);
  }
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
  const std::vector<float> given = (next_.valid() ? std::move(next_) : load(index)).get();
  if (index + 1 < shots_.all.size()) next_ = load(index + 1);
  vsplat_comparison found = VSPLAT_COMPARISON_INIT;
  vsplat::Picture difference;
  if (!differences_.empty()) difference.colour.resize(given.size());
  vsplat::check(vsplat_compare(drawn.colour.data(), given.data(), drawn.width, drawn.height, &found,
                               differences_.empty() ? nullptr : difference.colour.data()));
  rows_.push_back({files_[index], found.psnr, found.ssim});
  if (!differences_.empty()) {
    difference.width = drawn.width;
    difference.height = drawn.height;
    difference.alpha.resize(given.size() / 3);
    for (float& v : difference.colour) v *= difference_gain;
    difference.save(outputs.begin(difference_file(differences_, index)), VSPLAT_PICTURE_PNG);
  }
  return number_text(found.psnr, 1);
}

Comparison::Row Comparison::mean() const {
  Row out{"", 0, 0};
  for (const Row& row : rows_) {
    out.psnr += row.psnr / static_cast<double>(rows_.size());
    out.ssim += row.ssim / static_cast<double>(rows_.size());
  }
  return out;
}

std::string Comparison::table() const {
  char head[64];
  std::snprintf(head, sizeof head, "%-8s %9s %8s  ", "picture", "PSNR, dB", "SSIM");
  std::string out = head + std::string("against\n");
  for (std::size_t i = 0; i < rows_.size(); ++i)
    out += line_text(index_text(i), rows_[i].psnr, rows_[i].ssim, rows_[i].file);
  const Row all = mean();
  out += line_text("mean", all.psnr, all.ssim, "");
  out.pop_back();
  return out;
}

nlohmann::ordered_json Comparison::json() const {
  nlohmann::ordered_json pictures = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    nlohmann::ordered_json row = {
        {"reference", rows_[i].file}, {"psnr", json_number(rows_[i].psnr)}, {"ssim", json_number(rows_[i].ssim)}};
    if (!differences_.empty()) row["difference"] = difference_file(differences_, i);
    pictures.push_back(std::move(row));
  }
  const Row all = mean();
  return {{"psnr", json_number(all.psnr)}, {"ssim", json_number(all.ssim)}, {"pictures", pictures}};
}

}  // namespace command
