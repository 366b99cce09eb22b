#include "model/io/reader/reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <thread>

#include "model/io/reader/sanitized.h"
#include "model/io/reader/start_program.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using read::BadMessage;
using read::Channel;
using read::Closed;
using read::Descriptor;
using read::Header;
using read::Kind;
using read::Late;
using read::Message;
using read::Packer;
using read::Unpacker;

constexpr std::size_t small_message = 1 << 16;
constexpr int most_questions = 10'000;  // about files that one file refers to

ReaderLimits& test_limits() {
  static ReaderLimits limits;
  return limits;
}

std::chrono::nanoseconds seconds(double count) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(count));
}

}  // namespace

std::string words_of_reader(std::string_view text) {
  std::string out;
  while (out.size() < 1000 && !text.empty()) {
    std::size_t piece = std::min<std::size_t>(text.size(), 100);  // printable()'s limit, without splitting characters
    while (piece < text.size() && piece > 90 && (static_cast<unsigned char>(text[piece]) >> 6) == 2) --piece;
    out += printable(text.substr(0, piece));
    text.remove_prefix(piece);
  }
  return out;
}

void set_reader_limits(const ReaderLimits& limits) { test_limits() = limits; }

Reader::Reader(const std::string& path, Kind what, std::string others)
    : path_(path), others_(std::move(others)), limits_(test_limits()) {
  if (what == Kind::hdf5) limits_.memory_per_byte = 0;  // requests on a large file need little memory
  const fs::path folder = fs::path(path).parent_path();
  roots_.add(folder.empty() ? "." : folder);
  start(what);
}

Reader::~Reader() {
  if (process_ >= 0) sys::kill_program(process_);
  end();
}

// Starts the program and checks its version. It has not read the file yet, so errors here are not the file's fault.
void Reader::start(Kind what) {
  const read::Started started = read::start_program(what == Kind::mesh ? "mesh" : "hdf5", memory());
  process_ = started.process;
  channel_ = std::make_unique<Channel>(Descriptor(started.socket));
  std::string says, why;
  try {
    channel_->expect_by(Channel::Clock::now() + seconds(30));
    const Message hello = channel_->receive_whole(small_message);
    if (hello.kind == Kind::hello) says = Unpacker(hello.body).text();
    why = fmt::format("is of another version (\"{}\"), \"{}\" is expected", words_of_reader(says), read::version());
  } catch (const Late&) {
    why = "does not start within 30 seconds";
  } catch (const BadMessage&) {
    why = "sends a first message that makes no sense";
  } catch (const Closed&) {
    why = "ends as soon as it starts";
  }
  if (says != read::version()) {
    if (process_ >= 0) sys::kill_program(process_);
    end();
    fail(Status::internal, "{}: {}; this program, which is installed beside the library, reads meshes and HDF5 files",
         started.program, why);
  }
  if (read::sanitized) channel_->while_waiting([this] { look_at_memory(); });
}

template <class F>
auto Reader::guarded(F&& call) {
  if (!gave_up_.empty()) fail(Status::format, "{}: {}", path_, gave_up_);
  try {
    return call();
  } catch (const Closed&) {
    crashed();
  } catch (const Late&) {
    give_up(Status::format, fmt::format("was not read within {:.0f} seconds; it is damaged, or made to waste time",
                                        std::max(1.0, std::round(seconds_))));
  } catch (const BadMessage& e) {
    senseless(e.what());
  }
}

std::uint64_t Reader::memory() const {
  const double wanted =
      static_cast<double>(limits_.memory) + static_cast<double>(limits_.memory_per_byte) * static_cast<double>(given_);
  return wanted < static_cast<double>(limits_.most_memory) ? static_cast<std::uint64_t>(wanted) : limits_.most_memory;
}

void Reader::ask(Kind kind, const Packer& body, std::uint64_t bytes) {
  guarded([&] {
    missing_.clear(), refused_.clear();
    questions_ = 0;
    seconds_ = limits_.seconds + static_cast<double>(bytes) / limits_.bytes_per_second;
    channel_->expect_by(Channel::Clock::now() + seconds(seconds_));
    // The program's own time limit is slightly later, in case this process has ended by then.
    Packer whole;
    whole.put(static_cast<std::uint32_t>(std::ceil(seconds_) + 2)).raw(body.body().data(), body.body().size());
    channel_->send(kind, whole);
  });
}

Header Reader::next_header(std::size_t most) {
  return guarded([&] {
    for (;;) {
      const Header header = channel_->receive(std::max(most, small_message));
      if (header.kind != Kind::open && header.kind != Kind::exists && header.kind != Kind::failed) {
        if (header.size > most) throw BadMessage(fmt::format("{} bytes where {} are possible", header.size, most));
        return header;
      }
      if (header.size > small_message) throw BadMessage(fmt::format("{} bytes of words", header.size));
      Message message{header.kind, std::vector<char>(static_cast<std::size_t>(header.size))};
      channel_->read(message.body.data(), message.body.size());
      if (message.kind == Kind::failed) complain(message);
      if (++questions_ > most_questions)
        give_up(Status::format, fmt::format("names more than {} files", most_questions));
      Unpacker in(message.body);
      answer(message.kind, in.text());
    }
  });
}

void Reader::body(void* to, std::size_t size) {
  guarded([&] { channel_->read(to, size); });
}

Message Reader::next(std::size_t most) {
  const Header header = next_header(most);
  Message out{header.kind, {}};
  try {
    out.body.resize(static_cast<std::size_t>(header.size));
  } catch (const std::bad_alloc&) {
    give_up(Status::memory, fmt::format("not enough host memory for {} bytes of it", header.size));
  }
  body(out.body.data(), out.body.size());
  return out;
}

// The file itself may be anywhere, and may be a link.
bool Reader::may_read(const std::string& name) {
  std::error_code ignored;
  try {
    if (!fs::equivalent(name, path_, ignored)) roots_.need(name, others_);
    return true;
  } catch (const Error& e) {
    if (refused_.empty()) refused_ = e.what();
    return false;
  }
}

void Reader::answer(Kind question, const std::string& asked) {
  std::unique_ptr<std::FILE, FileCloser> file;
  std::error_code ignored;
  std::string name = asked;
  const bool is_name = name.find('\0') == std::string::npos;
  if (const bool there = is_name && fs::exists(name, ignored); !there && is_name && search_)
    if (const std::string found = search_(name); !found.empty()) name = found;
  bool yes = is_name && fs::exists(name, ignored);
  if (!yes && question == Kind::open && missing_.empty()) missing_ = name;
  yes = yes && may_read(name);
  std::optional<sys::FileFacts> found;
  if (yes && question == Kind::open) try {
      file = open_regular(name);
      found = sys::facts_of(file.get());
      if (!found) file.reset();
      yes = file != nullptr;
    } catch (const Error& e) {
      if (refused_.empty()) refused_ = e.what();
      yes = false;
    }
  const bool is_new = file && seen_.emplace(found->device, found->node).second;  // some files are opened repeatedly
  const auto bytes = is_new ? found->size : 0;
  given_ += bytes;
  const double more = limits_.memory_per_byte > 0 ? static_cast<double>(bytes) / limits_.bytes_per_second : 0;
  seconds_ += more;
  channel_->expect_by(channel_->deadline() + seconds(more));
  Packer body;
  body.put(std::uint32_t{yes}).put(static_cast<std::uint32_t>(std::ceil(more))).put(memory());
  channel_->send(Kind::answer, body, file ? sys::number_of(file.get()) : -1);
}

void Reader::complain(const Message& failed) {
  Unpacker in(failed.body);
  const auto status = in.get<std::uint32_t>();
  const std::string place = in.text(small_message), text = in.text(small_message);
  in.end();
  const bool is_input = status == static_cast<std::uint32_t>(Status::input);
  const std::string where = place.empty() ? path_ : path_ + ": " + words_of_reader(place);
  if (!refused_.empty()) fail(Status::file, "{}: {}", where, refused_);
  throw Error(is_input ? Status::input : Status::format, where + ": " + words_of_reader(text));
}

// The kernel also kills the reader if its control group runs out of memory.
void Reader::crashed() {
  const sys::ProgramEnd how = end();
  if (how.signal != 0) {
    if (how.out_of_time) give_up(Status::format, "was not read in time; it is damaged, or made to waste time");
    give_up(Status::format, fmt::format("its reader crashed (signal {}, {}): the file is damaged, or it triggers a "
                                        "fault in the library that reads such files",
                                        how.signal, sys::signal_name(how.signal)));
  }
  give_up(Status::format,
          "its reader ended without an answer: the file is damaged, or it triggers a fault in the library that reads "
          "such files");
}

void Reader::senseless(const std::string& why) {
  give_up(Status::format, fmt::format("its reader's answer makes no sense ({}): the file is damaged, or it triggers a "
                                      "fault in the library that reads such files",
                                      words_of_reader(why)));
}

void Reader::give_up(Status status, const std::string& why) {
  if (process_ >= 0) sys::kill_program(process_);
  end();
  gave_up_ = why;
  fail(status, "{}: {}", path_, why);
}

sys::ProgramEnd Reader::end() {
  using State = sys::ProgramEnd::State;
  channel_.reset();
  if (process_ < 0) return {};
  sys::ProgramEnd out{State::runs};
  for (int i = 0; i < 200 && out.state == State::runs; ++i) {  // one second in total
    out = sys::end_of(process_, sys::Wait::no);
    if (out.state == State::runs) std::this_thread::sleep_for(std::chrono::milliseconds(i < 20 ? 1 : 5));
  }
  if (out.state == State::runs) {
    sys::kill_program(process_);
    out = sys::end_of(process_, sys::Wait::until_it_has_ended);
  }
  process_ = -1;
  return out;
}

// For sanitizer builds, whose address space cannot be limited.
void Reader::look_at_memory() {
  if (sys::memory_of(process_) > memory())
    give_up(Status::format,
            fmt::format("reading it takes more than {} MiB of memory; it is damaged, or made to exhaust memory",
                        memory() >> 20));
}

}  // namespace vsplat
