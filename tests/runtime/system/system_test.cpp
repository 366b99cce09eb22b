// The functions of the operating system: the results that callers rely on, sizes of 0 and 1, and cases in which
// something is missing or in the way.
#include "runtime/system/system.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>

#include "runtime/system/system_channel.h"
#include "runtime/system/system_process.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using test::put_file;
using test::TemporaryFolder;

std::string text_at(const std::string& path, std::uint64_t offset, std::size_t bytes) {
  std::error_code error;
  const sys::Handle file = sys::open_to_read(path, error);
  EXPECT_FALSE(error) << error.message();
  std::string out(bytes, '?');
  out.resize(sys::read_at(file, offset, out.data(), bytes, error));
  EXPECT_FALSE(error) << error.message();
  return out;
}

TEST(SystemFiles, FactsTellOneFromAnother) {
  const TemporaryFolder folder;
  EXPECT_FALSE(sys::facts_of(folder / "missing"));
  EXPECT_FALSE(sys::facts_of_entry(folder / "missing"));
  std::error_code error;
  EXPECT_FALSE(sys::facts_of(sys::Handle(), error));
  EXPECT_EQ(error, std::errc::bad_file_descriptor);
  put_file(folder / "empty", "");
  put_file(folder / "one", "1");
  fs::create_symlink("one", folder / "link");
  fs::create_symlink("missing", folder / "nowhere");
  fs::create_hard_link(folder / "one", folder / "same");
  const auto empty = sys::facts_of(folder / "empty"), one = sys::facts_of(folder / "one");
  ASSERT_TRUE(empty && one);
  EXPECT_TRUE(empty->is_file() && empty->size == 0);
  EXPECT_TRUE(one->is_file() && one->size == 1);
  EXPECT_FALSE(one->same_as(*empty));
  EXPECT_TRUE(one->same_as(*sys::facts_of(folder / "same")));
  EXPECT_TRUE(one->same_as(*sys::facts_of(folder / "link")));
  EXPECT_FALSE(one->same_as(*sys::facts_of_entry(folder / "link")));
  EXPECT_EQ(sys::facts_of_entry(folder / "link")->kind, sys::FileFacts::Kind::other);
  EXPECT_FALSE(sys::facts_of(folder / "nowhere"));
  EXPECT_TRUE(sys::facts_of_entry(folder / "nowhere"));
  EXPECT_TRUE(sys::facts_of(folder.path())->is_folder());
  EXPECT_EQ(sys::facts_of("/dev/null")->kind, sys::FileFacts::Kind::other);
  const sys::Handle opened = sys::open_to_read(folder / "one", error);
  EXPECT_TRUE(one->same_as(*sys::facts_of(opened, error)));
  EXPECT_FALSE(error);
  struct stat found {};
  ASSERT_EQ(::stat((folder / "one").c_str(), &found), 0);
  EXPECT_EQ(one->changed, found.st_mtim.tv_sec);
  EXPECT_EQ(one->changed_ns, found.st_mtim.tv_nsec);
}

TEST(SystemFiles, FactsTellWhoMayWrite) {
  const TemporaryFolder folder;
  const std::string path = folder / "a";
  put_file(path, "");
  const auto ours = [&](mode_t mode) { return ::chmod(path.c_str(), mode) == 0 && sys::facts_of(path)->ours_alone; };
  EXPECT_TRUE(ours(0644) && ours(0600) && ours(0755));
  EXPECT_FALSE(ours(0664) || ours(0646));
  if (::geteuid() != 0) GTEST_SKIP() << "only root gives files away";
  ASSERT_EQ(::chown(path.c_str(), 12345, static_cast<gid_t>(-1)), 0);
  EXPECT_FALSE(ours(0644));
}

TEST(SystemFiles, ReadsFromTheGivenPlace) {
  const TemporaryFolder folder;
  put_file(folder / "empty", "");
  put_file(folder / "six", "abcdef");
  EXPECT_EQ(text_at(folder / "empty", 0, 0), "");
  EXPECT_EQ(text_at(folder / "empty", 0, 1), "");
  EXPECT_EQ(text_at(folder / "six", 0, 0), "");
  EXPECT_EQ(text_at(folder / "six", 2, 1), "c");
  EXPECT_EQ(text_at(folder / "six", 4, 100), "ef");
  EXPECT_EQ(text_at(folder / "six", 7, 1), "");
  std::error_code error;
  char byte = 0;
  const sys::Handle none = sys::open_folder(folder / "six", error);
  EXPECT_FALSE(none.good());
  EXPECT_EQ(error, std::errc::not_a_directory);
  const sys::Handle itself = sys::open_folder(folder.path(), error);
  EXPECT_TRUE(itself.good() && !error);
  EXPECT_EQ(sys::read_at(itself, 0, &byte, 1, error), 0u);
  EXPECT_EQ(error, std::errc::is_a_directory);
}

TEST(SystemFiles, OpensNothingElse) {
  const TemporaryFolder folder;
  std::error_code error;
  EXPECT_FALSE(sys::open_to_read(folder / "missing", error).good());
  EXPECT_EQ(error, std::errc::no_such_file_or_directory);
  put_file(folder / "one", "1");
  fs::create_symlink("one", folder / "link");
  EXPECT_TRUE(sys::open_to_read(folder / "link", error).good());
  EXPECT_FALSE(error);
  EXPECT_FALSE(sys::open_to_read(folder / "link", error, sys::Links::refused).good());
  EXPECT_EQ(error, std::errc::too_many_symbolic_link_levels);
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  const sys::Handle pipe = sys::open_to_read(folder / "pipe", error);  // does not wait for a writer
  ASSERT_TRUE(pipe.good());
  EXPECT_EQ(sys::facts_of(pipe, error)->kind, sys::FileFacts::Kind::other);
}

TEST(SystemFiles, CreatesWhatIsNotThere) {
  const TemporaryFolder folder;
  std::error_code error;
  sys::Handle made = sys::create_new(folder / "a", sys::Whose::owner, error);
  ASSERT_TRUE(made.good() && !error);
  EXPECT_EQ(fs::status(folder / "a").permissions(), fs::perms::owner_read | fs::perms::owner_write);
  std::FILE* file = sys::stream(std::move(made), "wb", error);
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(std::fwrite("abc", 1, 3, file), 3u);
  EXPECT_EQ(std::fflush(file), 0);
  EXPECT_FALSE(sys::sync(file));
  EXPECT_EQ(sys::facts_of(file)->size, 3u);
  std::fclose(file);
  EXPECT_FALSE(sys::create_new(folder / "a", sys::Whose::everybody, error).good());
  EXPECT_EQ(error, std::errc::file_exists);
  EXPECT_EQ(text_at(folder / "a", 0, 10), "abc");
  fs::create_symlink("missing", folder / "nowhere");
  EXPECT_FALSE(sys::create_new(folder / "nowhere", sys::Whose::everybody, error).good());
  EXPECT_EQ(error, std::errc::file_exists);
  EXPECT_FALSE(fs::exists(folder / "missing"));
  EXPECT_FALSE(sys::create_new(folder / "no/a", sys::Whose::everybody, error).good());
  EXPECT_EQ(error, std::errc::no_such_file_or_directory);
  EXPECT_EQ(sys::stream(sys::Handle(), "rb", error), nullptr);
  EXPECT_EQ(error, std::errc::bad_file_descriptor);
}

TEST(SystemFiles, SeeksInWhatIsRead) {
  const TemporaryFolder folder;
  put_file(folder / "six", "abcdef");
  std::error_code error;
  std::FILE* file = sys::stream(sys::open_to_read(folder / "six", error), "rb", error);
  ASSERT_NE(file, nullptr);
  EXPECT_FALSE(sys::seek(file, 4));
  EXPECT_EQ(std::fgetc(file), 'e');
  EXPECT_EQ(sys::seek(file, ~std::uint64_t{0}), std::errc::invalid_argument);
  std::fclose(file);
}

TEST(SystemFolders, RenamesOntoNothing) {
  const TemporaryFolder folder;
  put_file(folder / "a", "a");
  put_file(folder / "b", "b");
  EXPECT_EQ(sys::rename_to_new(folder / "a", folder / "b"), std::errc::file_exists);
  EXPECT_EQ(text_at(folder / "b", 0, 1), "b");
  EXPECT_EQ(sys::link(folder / "a", folder / "b"), std::errc::file_exists);
  EXPECT_EQ(sys::rename_to_new(folder / "missing", folder / "c"), std::errc::no_such_file_or_directory);
  EXPECT_FALSE(sys::exchange(folder / "a", folder / "b"));
  EXPECT_EQ(text_at(folder / "a", 0, 1), "b");
  EXPECT_EQ(text_at(folder / "b", 0, 1), "a");
  EXPECT_FALSE(sys::rename_to_new(folder / "a", folder / "c"));
  EXPECT_EQ(text_at(folder / "c", 0, 1), "b");
  EXPECT_FALSE(sys::link(folder / "c", folder / "d"));
  EXPECT_TRUE(sys::facts_of(folder / "c")->same_as(*sys::facts_of(folder / "d")));
}

TEST(SystemFolders, TakesAwayWhatIsMeant) {
  const TemporaryFolder folder;
  EXPECT_FALSE(sys::make_folder(folder / "mine", sys::Whose::owner));
  EXPECT_EQ(fs::status(folder / "mine").permissions(), fs::perms::owner_all);
  EXPECT_EQ(sys::make_folder(folder / "mine", sys::Whose::owner), std::errc::file_exists);
  EXPECT_EQ(sys::make_folder(folder / "no/mine", sys::Whose::owner), std::errc::no_such_file_or_directory);
  sys::remove_file(folder / "mine");
  EXPECT_TRUE(fs::exists(folder / "mine"));
  put_file(folder / "mine/a", "");
  sys::remove_folder(folder / "mine");
  sys::remove_folder(folder / "mine/a");
  EXPECT_TRUE(fs::exists(folder / "mine/a"));
  sys::remove_file(folder / "mine/a");
  sys::remove_folder(folder / "mine");
  EXPECT_FALSE(fs::exists(folder / "mine"));
}

TEST(SystemFolders, TriesWithoutATrace) {
  const TemporaryFolder folder;
  put_file(folder / "a", "");
  EXPECT_FALSE(sys::try_new_file_in(folder.path()));
  EXPECT_FALSE(sys::try_new_file_in(folder.path(), 4096));
  EXPECT_TRUE(sys::try_new_file_in(folder.path(), std::size_t{1} << 62)) << "more than any disk has";
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  EXPECT_EQ(sys::try_new_file_in(folder / "missing"), std::errc::no_such_file_or_directory);
  EXPECT_EQ(sys::try_new_file_in(folder / "a"), std::errc::not_a_directory);
  EXPECT_FALSE(sys::try_device("/dev/null"));
  EXPECT_EQ(sys::try_device(folder / "missing"), std::errc::no_such_file_or_directory);
  EXPECT_EQ(sys::group_of(folder / "missing"), "");
}

TEST(SystemFolders, HasOneLock) {
  const TemporaryFolder folder;
  std::error_code error;
  sys::Handle first = sys::open_folder(folder.path(), error);
  const sys::Handle second = sys::open_folder(folder.path(), error);
  EXPECT_TRUE(sys::lock(first));
  EXPECT_FALSE(sys::lock(second));
  first = sys::Handle();
  EXPECT_TRUE(sys::lock(second));
}

TEST(SystemFolders, HasOneLockAmongProcesses) {
  const TemporaryFolder folder;
  sys::Handle ours, its;
  ASSERT_FALSE(sys::make_channel(ours, its));
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    std::error_code error;
    const sys::Handle held = sys::open_folder(folder.path(), error);
    const char done = sys::lock(held) ? 'y' : 'n';
    sys::send_some(its, &done, 1);
    for (;;) ::pause();
  }
  char done = 0;
  ASSERT_EQ(sys::wait_for(ours, sys::Way::in, 30'000), sys::Ready::yes);
  ASSERT_EQ(sys::receive_some(ours, &done, 1).bytes, 1u);
  EXPECT_EQ(done, 'y');
  std::error_code error;
  const sys::Handle held = sys::open_folder(folder.path(), error);
  EXPECT_FALSE(sys::lock(held));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_TRUE(sys::lock(held));
}

TEST(SystemChannel, TakesBytesAndFiles) {
  const TemporaryFolder folder;
  put_file(folder / "a", "abc");
  sys::Handle one, other;
  ASSERT_FALSE(sys::make_channel(one, other));
  char got[8] = {};
  EXPECT_EQ(sys::wait_for(other, sys::Way::in, 1), sys::Ready::not_yet);
  const sys::Moved nothing = sys::receive_some(other, got, sizeof got);
  EXPECT_TRUE(nothing.open && nothing.bytes == 0);
  EXPECT_EQ(sys::wait_for(one, sys::Way::out, -1), sys::Ready::yes);
  EXPECT_EQ(sys::send_some(one, "x", 1).bytes, 1u);
  EXPECT_EQ(sys::wait_for(other, sys::Way::in, -1), sys::Ready::yes);
  sys::Handle file;
  EXPECT_EQ(sys::receive_some(other, got, sizeof got, &file).bytes, 1u);
  EXPECT_FALSE(file.good());
  std::error_code error;
  const sys::Handle opened = sys::open_to_read(folder / "a", error);
  EXPECT_EQ(sys::send_some(one, "yz", 2, opened.number()).bytes, 2u);
  EXPECT_EQ(sys::receive_some(other, got, sizeof got, &file).bytes, 2u);
  ASSERT_TRUE(file.good());
  EXPECT_TRUE(sys::facts_of(file, error)->same_as(*sys::facts_of(opened, error)));
  one = sys::Handle();
  EXPECT_EQ(sys::wait_for(other, sys::Way::in, -1), sys::Ready::yes);
  EXPECT_FALSE(sys::receive_some(other, got, sizeof got, &file).open);
  EXPECT_FALSE(sys::receive_some(other, got, sizeof got).open);
  EXPECT_FALSE(sys::send_some(other, "x", 1).open);
}

TEST(SystemProcess, KnowsWhereItIs) {
  EXPECT_EQ(sys::process_id(), ::getpid());
  std::error_code error;
  EXPECT_TRUE(fs::is_regular_file(sys::program_path(error)));
  const sys::Host host = sys::this_host();
  EXPECT_FALSE(host.kernel.empty() || host.machine.empty() || host.libc.empty());
  EXPECT_GT(host.processors, 0);
  EXPECT_GT(host.memory, std::uint64_t{1} << 28);
  EXPECT_GT(sys::free_memory(), 0u);
  EXPECT_FALSE(sys::host_name().empty());
  sys::set_variable("VSPLAT_SYSTEM_TEST", "first");
  sys::set_variable("VSPLAT_SYSTEM_TEST", "second");
  EXPECT_STREQ(std::getenv("VSPLAT_SYSTEM_TEST"), "first");
  ::unsetenv("VSPLAT_SYSTEM_TEST");
}

TEST(SystemProcess, KnowsItsLibraries) {
  std::string why;
  EXPECT_EQ(sys::load_library("/nowhere/libnothing.so", sys::Symbols::own, why), nullptr);
  EXPECT_NE(why.find("/nowhere/libnothing.so"), std::string::npos) << why;
  void* maths = sys::load_library("libm.so.6", sys::Symbols::own, why);
  ASSERT_NE(maths, nullptr) << why;
  EXPECT_EQ(why, "");
  EXPECT_EQ(sys::symbol(maths, "no_such_function"), nullptr);
  const void* cosine = sys::symbol(maths, "cos");
  ASSERT_NE(cosine, nullptr);
  EXPECT_NE(sys::library_of(cosine).find("libm.so.6"), std::string::npos);
  const int on_the_stack = 0;
  EXPECT_EQ(sys::library_of(&on_the_stack), "");
}

class StartedProgram {
 public:
  explicit StartedProgram(const std::string& script) {
    sys::Handle its;
    EXPECT_FALSE(sys::make_channel(ours, its));
    std::error_code error;
    number = sys::start_program("/bin/sh", {"-c", script}, its, "VSPLAT_HIDDEN", error);
    EXPECT_FALSE(error) << error.message();
  }
  // All output to its third descriptor.
  std::string heard() const {
    std::string out;
    for (char piece[256];;) {
      if (sys::wait_for(ours, sys::Way::in, 30'000) != sys::Ready::yes) return out + " and no end";
      const sys::Moved moved = sys::receive_some(ours, piece, sizeof piece);
      if (!moved.open) return out;
      out.append(piece, moved.bytes);
    }
  }
  sys::Handle ours;
  int number = -1;
};

TEST(SystemProgram, SpeaksOnItsThirdDescriptor) {
  sys::set_variable("VSPLAT_HIDDEN_ONE", "no");
  sys::set_variable("VSPLAT_SHOWN_ONE", "yes");
  const sys::Handle kept(::dup2(2, 50));  // like a handle opened without O_CLOEXEC
  const StartedProgram program("echo \"<$VSPLAT_HIDDEN_ONE$VSPLAT_SHOWN_ONE>\" >&3; ls -d /proc/$$/fd/* >&3; exit 7");
  const std::string heard = program.heard();
  EXPECT_EQ(heard.substr(0, 6), "<yes>\n");
  EXPECT_NE(heard.find("/fd/3\n"), std::string::npos) << heard;
  EXPECT_EQ(heard.find("/fd/50\n"), std::string::npos) << heard;
  const sys::ProgramEnd end = sys::end_of(program.number, sys::Wait::until_it_has_ended);
  EXPECT_EQ(end.state, sys::ProgramEnd::State::ended);
  EXPECT_EQ(end.signal, 0);
  EXPECT_EQ(sys::end_of(program.number, sys::Wait::no).state, sys::ProgramEnd::State::unknown);  // already reaped
  ::unsetenv("VSPLAT_HIDDEN_ONE");
  ::unsetenv("VSPLAT_SHOWN_ONE");
}

TEST(SystemProgram, IsKilledAndEndsOfTime) {
  const StartedProgram program("echo >&3; while :; do sleep 1; done");
  char line = 0;
  ASSERT_EQ(sys::wait_for(program.ours, sys::Way::in, 30'000), sys::Ready::yes);
  sys::receive_some(program.ours, &line, 1);
  EXPECT_EQ(sys::end_of(program.number, sys::Wait::no).state, sys::ProgramEnd::State::runs);
  EXPECT_GT(sys::memory_of(program.number), 10'000u);
  sys::kill_program(program.number);
  sys::ProgramEnd end = sys::end_of(program.number, sys::Wait::until_it_has_ended);
  EXPECT_EQ(end.signal, SIGKILL);
  EXPECT_FALSE(end.out_of_time);
  EXPECT_EQ(sys::signal_name(end.signal), "Killed");
  EXPECT_EQ(sys::memory_of(program.number), 0u);
  end = sys::end_of(StartedProgram("kill -ALRM $$").number, sys::Wait::until_it_has_ended);
  EXPECT_TRUE(end.out_of_time && end.signal == SIGALRM);
}

TEST(SystemProgram, ThatIsMissingIsNotStarted) {
  std::error_code error, no_pipe;
  EXPECT_LT(sys::start_program("/nowhere/program", {}, sys::Handle(), "X", error), 0);
  EXPECT_EQ(error, std::errc::no_such_file_or_directory);
  sys::watch_program("/nowhere/program", {}, {1, 1, 1}, no_pipe, error);
  EXPECT_FALSE(no_pipe);
  EXPECT_EQ(error, std::errc::no_such_file_or_directory);
}

// Its output is in the log, and a stop reaches what it has started, too.
TEST(SystemProgram, WritesALogAndStopsWithWhatItStarted) {
  const TemporaryFolder folder;
  std::error_code error;
  const auto started = [&](const std::string& name, const std::string& script) {
    const sys::Handle log = sys::create_new(folder / name, sys::Whose::everybody, error);
    EXPECT_FALSE(error);
    return sys::start_logged_program("/bin/sh", {"-c", script}, log, error);
  };
  const auto wait_for = [&](const std::string& text) {
    bool found = false;
    for (int i = 0; i < 200 && !found; ++i, ::usleep(50000))
      found = text_at(folder / "second", 0, 100).find(text) != std::string::npos;
    return found;
  };
  const int first = started("first", "echo out; echo error >&2; cat; exit 9");
  EXPECT_EQ(sys::end_of(first, sys::Wait::until_it_has_ended).exit_code, 9);
  EXPECT_EQ(text_at(folder / "first", 0, 100), "out\nerror\n");
  const int second =
      started("second", "(trap 'echo stopped; exit' TERM; echo runs; while :; do sleep 0.05; done) & wait");
  EXPECT_TRUE(wait_for("runs\n"));
  sys::stop_program_group(second);
  EXPECT_EQ(sys::end_of(second, sys::Wait::until_it_has_ended).signal, SIGTERM);
  EXPECT_TRUE(wait_for("stopped\n"));  // the shell may write of its own that it was terminated
}

TEST(SystemProgram, TellsWhileItIsWatched) {
  std::error_code no_pipe, error;
  const auto watched = [&](const std::string& script, double seconds) {
    return sys::watch_program("/bin/sh", {"-c", script}, {4, 3, seconds}, no_pipe, error);
  };
  sys::WatchedEnd end = watched("printf abcdef >&3; printf 12345; exit 9", 60);
  EXPECT_FALSE(no_pipe || error);
  EXPECT_EQ(end.report, "abcd");
  EXPECT_EQ(end.said, "345");
  EXPECT_EQ(end.exit_code, 9);
  EXPECT_FALSE(end.too_late || end.unknown);
  EXPECT_EQ(watched("kill -SEGV $$", 60).signal, SIGSEGV);
  EXPECT_TRUE(watched("sleep 60", 0.1).too_late);
  EXPECT_EQ(watched("true", 60).exit_code, 0);
}

}  // namespace
}  // namespace vsplat
