// The library, as the reader sees it: what it is asked for, the files that it is given, what it answers.
#pragma once
#include <map>
#include <string>

#include "model/io/reader/channel.h"
#include "runtime/error.h"

namespace vsplat::read {

// What is wrong, and where in the file.
class Wrong : public std::runtime_error {
 public:
  Wrong(Status status, std::string place, const std::string& text)
      : std::runtime_error(text), status_(status), place_(std::move(place)) {}
  Status status() const { return status_; }
  const std::string& place() const { return place_; }

 private:
  Status status_;
  std::string place_;
};

class Library {
 public:
  explicit Library(int socket) : channel_(Descriptor(socket)) {}

  // A file, given open; no good one where there is none, or it may not be read.
  Descriptor open(const std::string& path);
  bool exists(const std::string& path);

  void say(Kind kind, const Packer& body = {}) { channel_.send(kind, body); }
  void say(const Wrong& wrong);
  // What it asks for next.
  Message asked() { return channel_.receive_whole(std::size_t{1} << 20); }

 private:
  bool ask(Kind kind, const std::string& path, Descriptor* file);

  Channel channel_;
};

// Says `wrong` of memory where it was short, whatever else `text` is.
[[noreturn]] void fail_reading(Status status, const std::string& place, const std::string& text);

// From here on it is remembered (memory_was_short()) where memory is refused.
void watch_memory();
bool memory_was_short();
Wrong short_of_memory();

}  // namespace vsplat::read
