// The library as seen from the reader: its requests, the files it passes on, and the answers to it.
#pragma once
#include <map>
#include <string>

#include "model/io/reader/channel.h"
#include "runtime/error.h"

namespace vsplat::read {

// An error, with its place in the file.
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

  // Requests an open file; an invalid handle if it does not exist or must not be read.
  Descriptor open(const std::string& path);
  bool exists(const std::string& path);

  void say(Kind kind, const Packer& body = {}) { channel_.send(kind, body); }
  void say(const Wrong& wrong);
  // Receives the library's next request.
  Message asked() { return channel_.receive_whole(std::size_t{1} << 20); }

 private:
  bool ask(Kind kind, const std::string& path, Descriptor* file);

  Channel channel_;
};

// Throws Wrong; if memory was short, with a message about that instead of `text`.
[[noreturn]] void fail_reading(Status status, const std::string& place, const std::string& text);

// Starts recording failed allocations for memory_was_short().
void watch_memory();
bool memory_was_short();
Wrong short_of_memory();

}  // namespace vsplat::read
