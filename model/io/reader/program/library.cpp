#include "model/io/reader/program/library.h"

#include <new>

#include "model/io/reader/program/confine.h"

namespace vsplat::read {
namespace {

bool was_short = false;

}  // namespace

void watch_memory() {
  was_short = false;
  std::set_new_handler([] {
    was_short = true;
    throw std::bad_alloc();
  });
}

bool memory_was_short() { return was_short; }

Wrong short_of_memory() {
  return {Status::format, "",
          "reading it takes more memory than a file of its size should; it is damaged, or made to exhaust memory"};
}

void fail_reading(Status status, const std::string& place, const std::string& text) {
  if (memory_was_short()) throw short_of_memory();
  throw Wrong(status, place, text);
}

bool Library::ask(Kind kind, const std::string& path, Descriptor* file) {
  if (path.size() > 4096) return false;
  channel_.send(kind, Packer().text(path));
  const Message answer = channel_.receive_whole(1024, file);
  Unpacker in(answer.body);
  const bool yes = in.flag();
  more_time(in.get<std::uint32_t>());
  limit_memory(in.get<std::uint64_t>());
  return yes;
}

Descriptor Library::open(const std::string& path) {
  Descriptor out;
  if (!ask(Kind::open, path, &out)) return Descriptor();
  return out;
}

bool Library::exists(const std::string& path) {
  Descriptor none;
  return ask(Kind::exists, path, &none);
}

void Library::say(const Wrong& wrong) {
  say(Kind::failed, Packer()
                        .put(static_cast<std::uint32_t>(wrong.status()))
                        .text(wrong.place().substr(0, 8000))
                        .text(std::string(wrong.what()).substr(0, 8000)));
}

}  // namespace vsplat::read
