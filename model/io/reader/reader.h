// The reader: an installed program in which libraries that were not written for malicious input (assimp, HDF5) read
// untrusted files. It can open no file, and its memory and time are limited; if it crashes, that is an error with the
// file's name. README.md beside this describes the confinement.
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

// For tests: uses this program instead of the installed one; "" restores the default.
void set_reader_program(const std::string& path);

struct ReaderLimits {
  std::uint64_t memory = std::uint64_t{768} << 20;  // address space in bytes; for a mesh, increased for each byte
  std::uint64_t memory_per_byte = 12;               // of the files passed to it
  std::uint64_t most_memory = std::uint64_t{16} << 30;
  double seconds = 12;  // wall-clock time per request, plus time for the bytes to read
  double bytes_per_second = 2 << 20;
};
// For tests: applies to every reader started afterwards.
void set_reader_limits(const ReaderLimits& limits);

// Printable form of text from the reader (from a library or from the file), for a message.
std::string words_of_reader(std::string_view text);

// The reader process of one file. Its calls throw Error with the reader's complaint about the file, or Error(format) if
// the process crashed, took too long, needed too much memory or sent an invalid message. All messages begin with the
// file's path.
class Reader {
 public:
  // Starts the process for a mesh or HDF5 file; reads nothing yet. `others` is how errors call files that this file
  // refers to ("its file"). Error(internal) if there is no reader.
  Reader(const std::string& path, read::Kind what, std::string others);
  ~Reader();
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  // Finds a file that is not at the path that the mesh file states. Returns its path, or "" if there is none. An
  // exception ends the reading.
  using Search = std::function<std::string(const std::string& name)>;
  void search_by(Search search) { search_ = std::move(search); }

  // Sends a request. `bytes`: the approximate size of what is requested, in addition to the file itself.
  void ask(read::Kind kind, const read::Packer& body, std::uint64_t bytes = 0);

  // next() returns the next message with a body of at most `most` bytes; next_header() and body() read it in two steps.
  // Meanwhile they open files that the file refers to, below its folder (Roots).
  read::Message next(std::size_t most);
  read::Header next_header(std::size_t most);
  void body(void* to, std::size_t size);
  // End the process. senseless() reports an invalid answer as Error(format).
  [[noreturn]] void give_up(Status status, const std::string& why);
  [[noreturn]] void senseless(const std::string& why);

  const std::string& path() const { return path_; }
  std::uint64_t given() const { return given_; }           // bytes of the files passed to it
  const std::string& missing() const { return missing_; }  // the first requested file that does not exist
  const std::string& refused() const { return refused_; }  // why the first refused file was not opened
  bool ended() const { return !channel_; }
  int process() const { return process_; }

 private:
  template <class F>
  auto guarded(F&& call);
  void start(read::Kind what);
  std::uint64_t memory() const;  // its limit
  void answer(read::Kind question, const std::string& asked);
  bool may_read(const std::string& name);
  void look_at_memory();
  [[noreturn]] void complain(const read::Message& failed);
  [[noreturn]] void crashed();
  sys::ProgramEnd end();  // waits briefly, then kills it

  std::string path_, others_;
  ReaderLimits limits_;
  Roots roots_;
  std::unique_ptr<read::Channel> channel_;
  int process_ = -1;
  std::uint64_t given_ = 0;
  std::set<std::pair<std::uint64_t, std::uint64_t>> seen_;  // the files passed to it
  int questions_ = 0;
  double seconds_ = 0;
  Search search_;
  std::string missing_, refused_;
  std::string gave_up_;  // the reason
};

}  // namespace vsplat
