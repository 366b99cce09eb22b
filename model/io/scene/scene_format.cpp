#include "model/io/scene/scene_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "model/io/any_case.h"
#include "model/io/foreign_file.h"
#include "model/io/scene/compressed_ply.h"
#include "model/io/scene/gltf_splats.h"
#include "model/io/scene/ply.h"
#include "model/io/scene/sog.h"
#include "model/io/scene/splat_file.h"
#include "model/io/scene/spz.h"
#include "model/io/scene/written_gaussians.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool is_ply(std::span<const std::byte> beginning) {
  const std::string_view text = text_of(beginning);
  return text.starts_with("ply\n") || text.starts_with("ply\r");
}

bool is_json(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  return first != text.npos && text[first] == '{';
}

bool is_sog_meta(std::string_view text) {
  // A codebook, which may be long, stands before the other fields.
  return is_json(text) && text.find("\"means\"") != text.npos && text.find("\"mins\"") != text.npos;
}

// A zip's first entry is one of SOG's: other zip archives are models, or arrays.
bool is_sog(std::span<const std::byte> beginning) {
  constexpr std::size_t at_length = 26, at_name = 30;
  const std::string_view text = text_of(beginning);
  if (is_sog_meta(text)) return true;
  if (!text.starts_with("PK\x03\x04") || text.size() < at_name) return false;
  const std::size_t length = static_cast<unsigned char>(text[at_length]) |
                             static_cast<std::size_t>(static_cast<unsigned char>(text[at_length + 1])) << 8;
  const std::string_view entry = text.substr(at_name, length);
  return entry.ends_with("meta.json") || entry.ends_with(".webp");
}

bool is_gltf(std::span<const std::byte> beginning) {
  const std::string_view text = text_of(beginning);
  const auto has = [&](std::string_view word) { return text.find(word) != text.npos; };
  // The index of a streamed SOG scene has an "asset", too.
  return is_json(text) && (has("KHR_gaussian_splatting") || (has("\"asset\"") && !has("\"lodLevels\"")));
}

Scene read_sog_bytes(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  if (is_json(text_of(content.first(std::min(content.size(), kSceneBeginning)))))
    fail(Status::format, "{}: the meta.json of a SOG scene, whose planes are files beside it: give its path", name);
  return read_sog(name, content, skipped);
}

Scene read_sog_path(const std::string& path, SkippedGaussians* skipped) {
  const std::vector<unsigned char> content = read_file(path);
  const std::string_view text(reinterpret_cast<const char*>(content.data()), content.size());
  return is_json(text) ? read_sog_folder(path, skipped) : read_sog(path, std::as_bytes(std::span(content)), skipped);
}

// Writes a format that has no options.
template <void (*write)(const std::string&, const Scene&)>
void write_plainly(const std::string& path, const Scene& scene, const SceneWriteOptions&) {
  write(path, scene);
}

constexpr SceneFieldSet kAllFields{true, true, true, true, true, true, true};
constexpr SceneFieldSet kAllOfVolumes{false, true, true, true, true, true, true};

constexpr SceneFormat gltf_row(std::string_view name, std::string_view title, std::string_view ending,
                               decltype(SceneFormat::recognises) recognises, decltype(SceneFormat::write) write) {
  return {.name = name,
          .title = title,
          .endings = ending,
          .sh_read = 3,
          .sh_written = 3,
          .lossless = true,
          .kept = kAllOfVolumes,
          .lost = "surfels; spherical harmonics of degree 4",
          .opened_by = "PlayCanvas, Babylon.js, three.js",
          .recognises = recognises,
          .read = read_gltf_scene,
          .read_path = read_gltf_file,
          .write = write};
}

// The first format that recognises a file's content reads it.
const std::array kSceneTable = {
    SceneFormat{.name = "ply",
                .title = "3DGS PLY",
                .endings = ".ply",
                .sh_read = 4,
                .sh_written = 4,
                .lossless = true,
                .kept = kAllFields,
                .lost = "nothing",
                .opened_by = "nearly every program for Gaussian splats",
                .recognises = is_ply,
                .read = read_ply,
                .read_path = read_ply,
                .write = write_plainly<write_ply>},
    // Its files are read as those of "ply", whose signature they have.
    SceneFormat{.name = "compressed-ply",
                .title = "PlayCanvas compressed PLY",
                .endings = ".compressed.ply",
                .sh_read = 4,
                .sh_written = 3,
                .kept = kAllOfVolumes,
                .lost = "more than 8 to 11 bits a value; coefficients beyond 4; the order; surfels",
                .opened_by = "SuperSplat, PlayCanvas, Spark, splat-transform",
                .read = read_ply,
                .read_path = read_ply,
                .write = write_plainly<write_compressed_ply>,
                .rounding = compressed_ply_rounding},
    SceneFormat{.name = "spz",
                .title = "SPZ",
                .endings = ".spz",
                .sh_read = 4,
                .sh_written = 4,
                .kept = {.antialias = true},
                .lost = "more than 24 bits a position and 8 bits any other value; coefficients beyond 1; surfels; near "
                        "plane, up, mirror point, detail, offset",
                .opened_by = "PlayCanvas, Niantic Studio, Scaniverse, splat-transform; versions 2 and 3: Spark",
                .recognises = is_spz,
                .read = read_spz,
                .write = [](const std::string& path, const Scene& scene,
                            const SceneWriteOptions& options) { write_spz(path, scene, options.spz_version); },
                .rounding = spz_rounding},
    SceneFormat{.name = "sog",
                .title = "SOG",
                .endings = ".sog",
                .sh_read = 3,
                .sh_written = 3,
                .kept = kAllOfVolumes,
                .lost = "more than 16 bits a position and 8 bits any other value; coefficients above degree 0 but for "
                        "those of a palette; the order; surfels",
                .opened_by = "PlayCanvas, SuperSplat, Spark, splat-transform",
                .recognises = is_sog,
                .read = read_sog_bytes,
                .read_path = read_sog_path,
                .write = write_plainly<write_sog>,
                .rounding = sog_rounding},
    gltf_row("glb", "GLB with KHR_gaussian_splatting", ".glb", is_glb, write_plainly<write_glb_scene>),
    gltf_row("gltf", "glTF with KHR_gaussian_splatting", ".gltf", is_gltf, write_plainly<write_gltf_scene>),
    // It has no signature, so that it comes last.
    SceneFormat{.name = "splat",
                .title = ".splat",
                .endings = ".splat",
                .sh_read = 0,
                .sh_written = 0,
                .kept = {},
                .lost = "spherical harmonics above degree 0; more than 8 bits a colour, opacity and rotation; the "
                        "order; surfels; near plane, up, mirror point, detail, offset, anti-aliasing",
                .opened_by = "antimatter15/splat, Spark, PlayCanvas, SuperSplat",
                .recognises = is_splat,
                .read = read_splat,
                .write = write_plainly<write_splat>,
                .rounding = splat_rounding},
};

// The length of the format's longest ending that `path` has; 0: none.
std::size_t ending_length(const SceneFormat& format, const std::string& path) {
  const std::string name = lower_case(path);
  std::size_t longest = 0;
  for (std::string_view rest = format.endings; !rest.empty();) {
    const std::string_view ending = rest.substr(0, rest.find(' '));
    rest.remove_prefix(std::min(rest.size(), ending.size() + 1));
    if (name.size() > ending.size() && name.ends_with(ending)) longest = std::max(longest, ending.size());
  }
  return longest;
}

const SceneFormat* by_ending(const std::string& path) {
  const auto shorter = [&](const SceneFormat& a, const SceneFormat& b) {
    return ending_length(a, path) < ending_length(b, path);
  };
  const auto found = std::max_element(kSceneTable.begin(), kSceneTable.end(), shorter);
  return ending_length(*found, path) ? &*found : nullptr;
}

// ".ply (3DGS PLY), .splat (...)" of the formats for which `has` is true.
template <class Has>
std::string list_of_formats(const Has& has) {
  std::string out;
  for (const SceneFormat& format : kSceneTable)
    if (has(format)) out += fmt::format("{}{} ({})", out.empty() ? "" : ", ", format.endings, format.title);
  return out;
}

std::vector<std::byte> beginning_of(const std::string& path) {
  const auto file = open_regular(path);
  std::vector<std::byte> out(kSceneBeginning);
  out.resize(std::fread(out.data(), 1, out.size(), file.get()));
  return out;
}

}  // namespace

std::span<const SceneFormat> scene_formats() { return kSceneTable; }

const SceneFormat& scene_format(std::string_view name) {
  std::string all;
  for (const SceneFormat& format : kSceneTable) {
    if (format.name == name) return format;
    all += fmt::format("{}{}", all.empty() ? "" : ", ", format.name);
  }
  fail(Status::usage, "no format of scenes is called \"{}\": one of {} is expected", printable(std::string(name)), all);
}

const SceneFormat& written_format(const std::string& path) {
  if (const SceneFormat* format = by_ending(path); format && format->write) return *format;
  fail(Status::usage, "{}: the name's ending says how a scene is written: one of {} is expected", printable(path),
       list_of_formats([](const SceneFormat& f) { return f.write != nullptr; }));
}

const SceneFormat& read_format(const std::string& name, std::span<const std::byte> beginning) {
  for (const SceneFormat& format : kSceneTable)
    if (format.read && format.recognises && format.recognises(beginning)) return format;
  if (const SceneFormat* format = by_ending(name); format && format->read) return *format;
  const std::string expected =
      fmt::format("a scene is expected: {}", list_of_formats([](const SceneFormat& f) { return f.read != nullptr; }));
  if (const auto kind = what_file_is(name, text_of(beginning)))
    fail(Status::format, "{}: {}{}{}; {}", name, kind->name, kind->advice.empty() ? "" : "; ", kind->advice, expected);
  fail(Status::format, "{}: none of the known kinds of files; {}", name, expected);
}

Scene read_scene(const std::string& path, SkippedGaussians* skipped) {
  const SceneFormat& format = read_format(path, beginning_of(path));
  if (format.read_path) return format.read_path(path, skipped);
  const std::vector<unsigned char> content = read_file(path);
  return format.read(path, std::as_bytes(std::span(content)), skipped);
}

Scene read_scene(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  const std::span beginning = content.first(std::min(content.size(), kSceneBeginning));
  return read_format(name, beginning).read(name, content, skipped);
}

void write_scene(const std::string& path, const Scene& scene, const SceneWriteOptions& options) {
  written_format(path).write(path, scene, options);
}

std::vector<std::string> losses(const SceneFormat& format, const Scene& scene) {
  std::vector<std::string> out;
  const SceneFieldSet& kept = format.kept;
  const Gaussians& g = scene.gaussians;
  if (g.sh_degree > format.sh_written)
    out.push_back(fmt::format("spherical harmonics of degree {} are cut to degree {}{}", g.sh_degree, format.sh_written,
                              format.sh_written ? "" : ": colours no longer depend on the direction"));
  if (g.kind == GaussianKind::surfel && !kept.surfels)
    out.push_back(fmt::format("surfels become Gaussians with a third standard deviation of {} times the smaller one",
                              kWrittenThickness));
  if (format.rounding)
    for (std::string& sentence : format.rounding(scene)) out.push_back(std::move(sentence));
  if (scene.near != Scene().near && !kept.near) out.push_back(fmt::format("the near plane, {}, is lost", scene.near));
  if (scene.up && !kept.up)
    out.push_back(fmt::format("the up direction, {} {} {}, is lost", (*scene.up)[0], (*scene.up)[1], (*scene.up)[2]));
  if (scene.mirror && !kept.mirror)
    out.emplace_back("the mirror point is lost: colours that depend on the direction are those seen from far away");
  if (scene.detail && !kept.detail) out.emplace_back("the resolution of the pictures that it was made from is lost");
  if (!scene.offset.isZero(0) && !kept.offset)
    out.emplace_back("the offset of the positions is lost, except for the file of the offset beside it");
  if (scene.antialias && !kept.antialias) out.emplace_back("that it is to be drawn with anti-aliasing is lost");
  return out;
}

}  // namespace vsplat
