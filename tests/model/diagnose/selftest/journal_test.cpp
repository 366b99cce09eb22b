// A self-test knows the place where an earlier one crashed.
#include "model/diagnose/selftest/journal.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using selftest::Journal;

class SelftestJournal : public ::testing::Test {
 protected:
  // A process that was killed while it did this.
  void end_in(const std::string& doing, const std::string& kernel) {
    const std::string kept = folder_.path() + "/kept.json";
    {
      Journal journal(own(), "");
      journal.begins("something before");
      journal.begins(doing);
      journal.compiles(kernel);
      std::filesystem::copy_file(file(), kept);
    }
    std::filesystem::create_directories(own());
    std::filesystem::rename(kept, file());
  }
  std::string own() const { return folder_.path() + "/own"; }
  std::string file() const { return own() + "/journal.json"; }

  test::TemporaryFolder folder_;
};

TEST_F(SelftestJournal, LeavesNothingWhereAllWasDone) {
  {
    Journal journal(own(), "");
    journal.begins("gemm");
    EXPECT_TRUE(std::filesystem::exists(file()));
    journal.done();
  }
  EXPECT_FALSE(std::filesystem::exists(file()));
  {
    Journal journal(own(), "");
    journal.begins("gemm");  // and left by an exception, as on Ctrl-C
  }
  EXPECT_EQ(Journal(own(), "").ended_by("gemm"), "");
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(SelftestJournal, BlamesWhatEndedAProcessBeforeSomebodysEyes) {
  end_in("gemm", "gemm_tile");
  Journal journal(own(), "signal 11");
  EXPECT_EQ(journal.ended_by("gemm"),
            "it ended the self-test's process: signal 11; the kernel compiled last was gemm_tile");
  EXPECT_EQ(journal.ended_by("something before"), "");
}

// A process may be killed from outside; twice at the same place is no coincidence.
TEST_F(SelftestJournal, BlamesTheSecondTimeWhereNobodySaw) {
  end_in("gemm", "");
  EXPECT_EQ(Journal(own(), "").ended_by("gemm"), "");
  end_in("gemm", "");
  EXPECT_EQ(Journal(own(), "").ended_by("gemm"), "it ended the self-test's process");
  Journal(own(), "").done();
  EXPECT_EQ(Journal(own(), "").ended_by("gemm"), "") << "what was reported is tried again";
}

TEST_F(SelftestJournal, KeepsNothingWithoutAFolderOrBesideAnother) {
  Journal nowhere("", "signal 11");
  nowhere.begins("gemm");
  EXPECT_EQ(nowhere.ended_by("gemm"), "");
  end_in("gemm", "");
  const Journal first(own(), "signal 11");
  Journal second(own(), "signal 11");
  second.begins("conv3d");
  EXPECT_EQ(second.ended_by("gemm"), "");
  EXPECT_NE(first.ended_by("gemm"), "");
}

TEST_F(SelftestJournal, TakesNothingFromAFileThatIsNone) {
  std::filesystem::create_directories(own());
  for (const char* text :
       {"", "{", "[]", "{\"doing\": 3}", "{\"doing\": \"gemm\", \"kernel\": \"\", \"ended\": [1]}"}) {
    std::ofstream(file()) << text;
    Journal journal(own(), "signal 11");
    EXPECT_EQ(journal.ended_by("gemm"), "") << text;
  }
}

}  // namespace
}  // namespace vsplat
