#include "model/io/archive/pickle.h"

#include <gtest/gtest.h>

#include "runtime/error.h"

namespace vsplat::pickle {
namespace {

Pickle read_text(const std::string& text) {
  return read("x", {reinterpret_cast<const unsigned char*>(text.data()), text.size()});
}

// Bytes that may contain zeros.
template <std::size_t size>
std::string bytes(const char (&text)[size]) {
  return {text, size - 1};
}

std::string refusal(const std::string& text) {
  try {
    read_text(text);
    return "accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::format);
    return e.what();
  }
}

// A tensor of 2 x 3 floats in a storage of `count` elements, from `offset` on.
std::string tensor(char count, char offset) {
  return bytes(
             "ctorch._utils\n_rebuild_tensor_v2\n((X\7\0\0\0storagectorch\nFloatStorage\nX\1\0\0\0"
             "0X\3\0\0\0cpuK") +
         count + bytes("tQK") + offset +
         bytes(
             "K\2K\3\x86K\3K\1\x86\x89"
             "ccollections\nOrderedDict\n)RtR");
}

TEST(Pickle, Values) {
  const std::string read =  // the values' texts point into it
      bytes("\x80\2(NK\7M\1\2J\xff\xff\xff\xff\x8a\2\0\x80\x8a\0G\0\0\0\0\0\0\0\0\x88\x89X\2\0\0\0abtq\1.");
  const Pickle p = read_text(read);
  const Value& root = p.at(p.root);
  ASSERT_EQ(root.kind, Kind::tuple);
  ASSERT_EQ(root.items.size(), 10u);
  const auto item = [&](std::size_t i) { return p.at(root.items[i]); };
  EXPECT_EQ(item(0).kind, Kind::none);
  EXPECT_EQ(item(1).number, 7);
  EXPECT_EQ(item(2).number, 513);
  EXPECT_EQ(item(3).number, -1);
  EXPECT_EQ(item(4).number, -32768);
  EXPECT_EQ(item(5).number, 0);
  EXPECT_EQ(item(6).kind, Kind::real);
  EXPECT_EQ(item(7).number, 1);
  EXPECT_EQ(item(8).number, 0);
  EXPECT_EQ(item(9).text, "ab");
}

TEST(Pickle, ATensorAndWhereItLies) {
  const std::string read = bytes("\x80\2}X\1\0\0\0a") + tensor(7, 1) + bytes("s.");
  const Pickle p = read_text(read);
  ASSERT_EQ(p.tensors.size(), 1u);
  EXPECT_EQ(p.tensors[0].shape, (Shape{2, 3}));
  EXPECT_EQ(p.tensors[0].strides, (std::vector<std::int64_t>{3, 1}));
  EXPECT_EQ(p.tensors[0].offset, 1);
  EXPECT_EQ(p.storages.at(0).key, "0");
  EXPECT_EQ(p.storages.at(0).count, 7u);
  EXPECT_EQ(p.at(p.root).kind, Kind::dict);
  EXPECT_NE(refusal(bytes("\x80\2") + tensor(6, 1) + ".").find("reaches beyond its storage of 6"), std::string::npos);
}

TEST(Pickle, RefusesByNameAndPlace) {
  const std::pair<std::string, const char*> cases[] = {
      {bytes("\x80\2cos\nsystem\nX\1\0\0\0a\x85R."), "byte 2: names \"os system\""},
      {bytes("\x80\2c__builtin__\neval\n."), "names \"__builtin__ eval\""},
      {bytes("\x80\2(X\1\0\0\0aios\nsystem\n."), "byte 9: the opcode INST"},
      {bytes("\x80\2N0."), "the opcode POP,"},
      {bytes("\x80\2ccollections\nOrderedDict\n)\x81."), "the opcode NEWOBJ"},
      {bytes("\x80\2ctorch\nFloatStorage\n)R."), "calls a global \"torch FloatStorage\""},
      {bytes("\x80\2X\1\0\0\0a)R."), "calls a text"},
      {bytes("\x80\2N}b."), "sets the state of None"},
      {bytes("\x80\4N."), "protocol 4, expected 2"},
      {bytes("N."), "does not begin with a protocol"},
      {bytes("\x80\2N.N"), "1 bytes follow the end"},
      {bytes("\x80\2NN."), "ends with 2 values"},
      {bytes("\x80\2."), "ends with 0 values"},
      {bytes("\x80\2X\xff\xff\xff\xff."), "cut off"},
      {bytes("\x80\2h\5."), "asks for number 5"},
      {bytes("\x80\2t."), "back to a mark"},
      {bytes("\x80\2\x85."), "takes 1 values"},
      {bytes("\x80\2\xff."), "0xff is no opcode"},
      {bytes("\x80\2Nr\xff\xff\xff\xff."), "beyond"},
      {bytes("\x80\2"
             "c\x1b]0;x\7\ny\n."),
       "names \"?]0;x? y\""},
  };
  for (const auto& [text, words] : cases) EXPECT_NE(refusal(text).find(words), std::string::npos) << refusal(text);
  EXPECT_NE(refusal(bytes("\x80\2(") + std::string(most_values + 1, 'N') + "t.").find("more than"), std::string::npos);
}

TEST(Pickle, InertGlobalsMakeNothing) {
  const std::string read = bytes("\x80\2ccollections\ndefaultdict\nc__builtin__\nint\n\x85RX\1\0\0\0aK\1s.");
  const Pickle p = read_text(read);
  EXPECT_EQ(p.at(p.root).kind, Kind::inert);
  EXPECT_EQ(p.at(p.root).text, "collections defaultdict");
  EXPECT_TRUE(p.at(p.root).items.empty());
}

}  // namespace
}  // namespace vsplat::pickle
