// The reader: an installed program in which what others made is read by libraries that were not made for strangers'
// files (assimp, HDF5). It can open nothing, has limits of memory and time, and where it crashes that is an error with
// the file's name. README.md beside this says what confines it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "model/io/reader/channel.h"
#include "runtime/error.h"
#include "runtime/files/roots.h"
#include "runtime/system/system_process.h"

namespace vsplat {

// Where the program is instead of beside the library; for tests. "": there again.
void set_reader_program(const std::string& path);

struct ReaderLimits {
  std::uint64_t memory = std::uint64_t{768} << 20;  // bytes of address space; for a mesh, so many more for each byte of
  std::uint64_t memory_per_byte = 12;               // the files that it is given
  std::uint64_t most_memory = std::uint64_t{16} << 30;
  double seconds = 12;  // of the clock on the wall for what is asked for; more by the bytes that are to be read
  double bytes_per_second = 2 << 20;
};
// For tests: of every reader that is started from then on.
void set_reader_limits(const ReaderLimits& limits);

// What the reader says in words, for a message: words of a library, and of the file.
std::string words_of_reader(std::string_view text);

// One file's. Its calls throw Error: what the reader says is wrong with the file; or format, where it crashed, took too
// long, needed too much memory or said what makes no sense. All begin with the file's path.
class Reader {
 public:
  // Starts it for a mesh or HDF5, and reads nothing yet. `others` is how what the file names is called in an error
  // ("its file"). Error(internal) where there is no reader.
  Reader(const std::string& path, read::Kind what, std::string others);
  ~Reader();
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  // Finds a file that is not where the read one says: its path, or "" where there is none. What it throws ends the
  // reading.
  using Search = std::function<std::string(const std::string& name)>;
  void search_by(Search search) { search_ = std::move(search); }

  // Asks for something. `bytes` is about how many it is, beside those of the file itself.
  void ask(read::Kind kind, const read::Packer& body, std::uint64_t bytes = 0);

  // The next message, its body of at most `most` bytes, or (header, body) its beginning. Meanwhile opens what the file
  // names, below the file's folder (Roots).
  read::Message next(std::size_t most);
  read::Header next_header(std::size_t most);
  void body(void* to, std::size_t size);
  // Ends it. senseless() is for an answer that is no good, whatever it be: Error(format).
  [[noreturn]] void give_up(Status status, const std::string& why);
  [[noreturn]] void senseless(const std::string& why);

  const std::string& path() const { return path_; }
  std::uint64_t given() const { return given_; }           // bytes of the files that it was given
  const std::string& missing() const { return missing_; }  // the first file that was asked for and is not there
  const std::string& refused() const { return refused_; }  // why the first one was not opened
  bool ended() const { return !channel_; }
  int process() const { return process_; }

 private:
  template <class F>
  auto guarded(F&& call);
  void start(read::Kind what);
  std::uint64_t memory() const;  // that it may have
  void answer(read::Kind question, const std::string& asked);
  bool may_read(const std::string& name);
  void look_at_memory();
  [[noreturn]] void complain(const read::Message& failed);
  [[noreturn]] void crashed();
  sys::ProgramEnd end();  // gives it a moment, then kills it

  std::string path_, others_;
  ReaderLimits limits_;
  Roots roots_;
  std::unique_ptr<read::Channel> channel_;
  int process_ = -1;
  std::uint64_t given_ = 0;
  std::set<std::pair<std::uint64_t, std::uint64_t>> seen_;  // of those files
  int questions_ = 0;
  double seconds_ = 0;
  Search search_;
  std::string missing_, refused_;
  std::string gave_up_;  // why
};

}  // namespace vsplat
