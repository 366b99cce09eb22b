// Files of another kind than expected: the message names the kind and how to convert it.
#include "model/io/foreign_file.h"

#include <gtest/gtest.h>

#include "model/io/picture/image_file.h"
#include "model/io/scene/ply.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using namespace std::string_literals;

struct OtherKind {
  std::string name, bytes;
  std::vector<std::string> words;
};

std::string media_of(const std::string& brand) { return "\0\0\0\x18"s + "ftyp" + brand + std::string(200, '\0'); }

TEST(ForeignFile, GivenAsAScene) {
  const test::TemporaryFolder folder;
  const std::string convert = "splat-transform ";
  const OtherKind all[] = {
      {"a.spz", "\x1f\x8b\x08" + std::string(50, 'x'), {"SPZ"}},
      {"b.spz", "NGSP" + std::string(50, 'x'), {"SPZ"}},
      {"c.ply", "\x1f\x8b\x08" + std::string(50, 'x'), {"gzip", "gunzip"}},
      {"a.splat", std::string(64, '\x7'), {".splat"}},
      {"my scene.ksplat", std::string(64, '\0'), {".ksplat", convert + "'my scene.ksplat' 'my scene.ply'"}},
      {"a.sog", "PK\x03\x04" + std::string(26, 'x') + "meta.json", {"SOG file of Gaussians"}},
      {"a.zip", "PK\x03\x04" + std::string(26, 'x') + "scene.ply", {"zip", "unpack"}},
      {"meta.json",
       R"({"version":2,"means":{"mins":[0,0,0],"files":["means_l.webp"]},"quats":{}})",
       {"meta.json of a SOG scene"}},
      {"a.glb", "glTF" + std::string(60, '\2'), {"GLB", "vsplat dataset render a.glb"}},
      {"a.gltf", R"({"asset":{"version":"2.0"}})", {"glTF", "vsplat dataset render"}},
      {"lod-meta.json",
       R"({"version":1,"asset":{"generator":"x"},"lodLevels":3})",
       {"streamed SOG", "meta.json of one"}},
      {"a.lcc", R"({"version":"2.0","asset":{}})", {"LCC", convert + "a.lcc a.ply"}},
      {"a.lcc2", std::string(64, '\7'), {"LCC"}},
      {"a.rad", "RAD0" + std::string(64, '\7'), {"RAD", "as PLY or SPZ"}},
      {"a.obj", "v 0 0 0\n", {"OBJ", "vsplat dataset render"}},
      {"a.ckpt", "PK\x03\x04" + std::string(26, 'x') + "archive/data.pkl", {"PyTorch", "vsplat weights import"}},
      {"transforms.json", R"({"frames":[]})", {"cameras", "this list as the cameras"}},
      {"lfs.ply", "version https://git-lfs.github.com/spec/v1\noid sha256:0\n", {"Git LFS", "git lfs pull"}},
      {"page.ply", "<!DOCTYPE html><html>", {"web page"}},
      {"photo.ply", "\xff\xd8\xff\xe0" + std::string(30, 'x'), {"JPEG picture"}},
      {"empty.ply", "", {"empty file"}}};
  for (const OtherKind& one : all) {
    test::put_file(folder / one.name, one.bytes);
    std::vector<std::string> words = one.words;
    words.push_back(folder / one.name);
    words.emplace_back("a PLY file is expected");
    test::expect_error(Status::format, words, [&] { read_ply(folder / one.name); });
  }
}

TEST(ForeignFile, GivenAsAPicture) {
  const test::TemporaryFolder folder;
  const OtherKind all[] = {{"a.jpg", media_of("heic"), {"HEIC", "heif-convert a.jpg a.png"}},
                           {"b.jpg", media_of("mif1"), {"HEIC"}},
                           {"c.png", media_of("avif"), {"AVIF", "avifdec"}},
                           {"d.jpg", media_of("qt  "), {"video", "ffmpeg"}},
                           {"d.png", "RIFF\1\2\3\4AVI LIST", {"a video (AVI)", "ffmpeg"}},
                           {"d.tif", "SQLite format 3", {"a database"}},
                           {"e.png", "GIF89a" + std::string(30, '\1'), {"GIF", "e.png e-converted.png"}},
                           {"f.jpg", "\xff\x0a" + std::string(30, '\1'), {"JPEG XL", "djxl"}},
                           {"g.jpg", "<html>", {"web page"}},
                           {"h.jpg", "version https://git-lfs.github.com/spec/v1\n", {"Git LFS"}},
                           {"i.jpg", "what nobody knows", {"none of the known picture formats"}}};
  for (const OtherKind& one : all) {
    test::put_file(folder / one.name, one.bytes);
    std::vector<std::string> words = one.words;
    words.push_back(folder / one.name);
    words.emplace_back("PNG, JPEG, EXR");
    test::expect_error(Status::format, words, [&] { read_image(folder / one.name); });
  }
}

}  // namespace
}  // namespace vsplat
