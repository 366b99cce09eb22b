#include "model/io/archive/torch_file.h"

#include <gtest/gtest.h>

#include "runtime/error.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

// A file that PyTorch made as a fuzzer seed.
std::string seed(const char* name) { return std::string(VSPLAT_TORCH_FILES) + "/" + name; }

std::string refusal(const std::string& path) {
  try {
    TorchFile file(path);
    file.verify();
    return "accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::format);
    return e.what();
  }
}

TEST(TorchFile, TensorsOfACheckpoint) {
  const TorchFile file(seed("lightning.ckpt"));
  ASSERT_EQ(file.tensors().size(), 3u);
  EXPECT_EQ(file.others(), (std::vector<std::string>{"epoch", "loops", "f"}));
  EXPECT_EQ(file.at("net.a").shape, (Shape{2, 3}));
  EXPECT_EQ(file.floats(file.at("net.a")), (std::vector<float>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(file.at("net.b").shape, (Shape{3, 2}));
  EXPECT_EQ(file.floats(file.at("net.b")), (std::vector<float>{0, 3, 1, 4, 2, 5}));
  EXPECT_EQ(file.at("net.c").dtype, Dtype::f16);
  EXPECT_EQ(file.floats(file.at("net.c")), (std::vector<float>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(file.find("a"), nullptr);
  EXPECT_THROW(file.at("a"), Error);
  EXPECT_NO_THROW(file.verify());
}

TEST(TorchFile, ABareStateDict) {
  const TorchFile file(seed("bare.pth"));
  EXPECT_TRUE(file.others().empty());
  EXPECT_EQ(file.floats(file.at("n")), (std::vector<float>{0, 1, 2}));
  EXPECT_EQ(file.floats(file.at("s")), (std::vector<float>{2}));
  EXPECT_TRUE(file.at("s").shape.empty());
  EXPECT_TRUE(file.floats(file.at("e")).empty());
}

TEST(TorchFile, DamageToAnArrayIsFound) {
  test::TemporaryFolder folder;
  std::string bytes = test::contents_of(seed("torch.pth"));
  const std::string value{'\0', '\0', '\x80', '\x3f'};  // 1
  const std::size_t at = bytes.find(value);
  ASSERT_NE(at, std::string::npos);
  bytes[at + 2] = '\x40';
  test::put_file(folder / "x.pth", bytes);
  EXPECT_NE(refusal(folder / "x.pth").find("data/0"), std::string::npos);
  EXPECT_EQ(refusal(seed("torch.pth")), "accepted");
}

// A checkpoint with one text in data.pkl replaced by another of the same length, and corrected checksums.
std::string renamed(const std::string& bytes, const std::string& from, const std::string& to) {
  std::string out = bytes;
  const auto number = [&](std::size_t at, std::size_t size) {
    std::size_t value = 0;
    for (std::size_t i = 0; i < size; ++i)
      value |= static_cast<std::size_t>(static_cast<unsigned char>(out[at + i])) << (8 * i);
    return value;
  };
  const std::size_t name = out.rfind("/data.pkl"), entry = out.rfind("PK\x01\x02", name);  // of the central directory
  const std::size_t size = number(entry + 20, 4), local = number(entry + 42, 4);
  const std::size_t begin = local + 30 + number(local + 26, 2) + number(local + 28, 2);
  const auto checksum = [&] {
    std::uint32_t crc = 0xffffffff;
    for (std::size_t i = begin; i < begin + size; ++i) {
      crc ^= static_cast<unsigned char>(out[i]);
      for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
    }
    crc = ~crc;
    return std::string(reinterpret_cast<const char*>(&crc), 4);
  };
  const std::string before = checksum();
  out.replace(out.find(from), from.size(), to);
  for (std::size_t at = out.find(before); at != std::string::npos; at = out.find(before, at + 4))
    out.replace(at, 4, checksum());
  return out;
}

TEST(TorchFile, AStateDictUnderAnyKey) {
  const test::TemporaryFolder folder;
  const std::string bytes = test::contents_of(seed("lightning.ckpt"));
  test::put_file(folder / "a.ckpt", renamed(bytes, "state_dict", "parameters"));
  const TorchFile file(folder / "a.ckpt");
  EXPECT_EQ(file.tensors().size(), 3u);
  EXPECT_EQ(file.floats(file.at("net.a")), (std::vector<float>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(file.others().size(), 3u);
}

TEST(TorchFile, WhatItLooksLike) {
  EXPECT_TRUE(TorchFile::looks_like(seed("torch.pth")));
  EXPECT_FALSE(TorchFile::looks_like(seed("none")));
  EXPECT_FALSE(TorchFile::looks_like(std::string(VSPLAT_TORCH_FILES)));
}

}  // namespace
}  // namespace vsplat
