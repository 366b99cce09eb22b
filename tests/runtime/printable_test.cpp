#include "runtime/printable.h"

#include <gtest/gtest.h>

namespace vsplat {
namespace {

TEST(Printable, KeepsTextAndReplacesTheRest) {
  EXPECT_EQ(printable(""), "");
  EXPECT_EQ(printable("a\tb\x7f"), "a?b?");
  EXPECT_EQ(printable("\xc3\xa4 \xe5\x9c\x96 \xf0\x9f\x90\x8e"), "\xc3\xa4 \xe5\x9c\x96 \xf0\x9f\x90\x8e");
  EXPECT_EQ(printable("\xc3"), "?");
  EXPECT_EQ(printable("\xc3("), "?(");
  EXPECT_EQ(printable("\xc2\x9b[2J"), "?[2J");  // a terminal's control sequence
  EXPECT_EQ(printable("\xff\x80"), "??");
}

// Names that look like others: U+202E reverses the text after it, U+2028 ends a line, U+200B is invisible.
TEST(Printable, WhatIsNotSeenIsReplaced) {
  EXPECT_EQ(printable("a\xe2\x80\xaegnp.exe"), "a?gnp.exe");
  EXPECT_EQ(printable("a\xe2\x80\xa8"
                      "b\xe2\x80\xa9"
                      "c"),
            "a?b?c");
  EXPECT_EQ(printable("\xef\xbb\xbfx\xe2\x80\x8bx\xe2\x81\xa6x\xc2\xadx\xd8\x9c"), "?x?x?x?x?");
  EXPECT_EQ(printable("\xf3\xa0\x81\x81"), "?");          // a tag
  EXPECT_EQ(printable("\xc2\x85\xc2\xa0"), "?\xc2\xa0");  // the C1 line end; a visible blank
}

TEST(Printable, WhatIsNoUtf8IsReplacedByteByByte) {
  EXPECT_EQ(printable("\xed\xa0\x80"), "?");    // a surrogate
  EXPECT_EQ(printable("\xe0\x80\xae"), "???");  // an overlong encoding
  EXPECT_EQ(printable("\xf0\x82\x82\xac"), "????");
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "????");  // beyond the last code point
}

TEST(Printable, ShellWordsAreQuotedIfTheyNeedIt) {
  EXPECT_EQ(shell_word("photos/walk-1.mp4"), "photos/walk-1.mp4");
  EXPECT_EQ(shell_word("\xc3\xa4.png"), "\xc3\xa4.png");
  EXPECT_EQ(shell_word("my photos"), "'my photos'");
  EXPECT_EQ(shell_word("it's"), "'it'\\''s'");
  EXPECT_EQ(shell_word("$(x);`y`"), "'$(x);`y`'");
  EXPECT_EQ(shell_word("a\nb"), "'a?b'");
  EXPECT_EQ(shell_word(""), "''");
  EXPECT_EQ(shell_word(std::string(300, 'x')), std::string(300, 'x'));
}

TEST(Printable, CutsBetweenCharacters) {
  EXPECT_EQ(printable(std::string(100, 'x')), std::string(100, 'x'));
  EXPECT_EQ(printable(std::string(101, 'x')), std::string(100, 'x') + "... (101 bytes)");
  EXPECT_EQ(printable(std::string(99, 'x') + "\xc3\xa4"), std::string(99, 'x') + "... (101 bytes)");
}

}  // namespace
}  // namespace vsplat
