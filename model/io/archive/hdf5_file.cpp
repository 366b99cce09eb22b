#include "model/io/archive/hdf5_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <list>
#include <mutex>
#include <tuple>

#include "model/io/foreign_file.h"
#include "model/io/reader/reader.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

using read::Kind;
using read::Message;
using read::Packer;
using read::Unpacker;

constexpr std::size_t most_idle = 8;

// Identifies a file and its state, to detect that it is unchanged.
struct Identity {
  explicit Identity(const std::string& of) : path(of), facts(sys::facts_of(of).value_or(sys::FileFacts())) {}
  // A file that was just written may be written again with the same timestamp.
  bool settled() const { return facts.changed > 0 && facts.changed + 2 < std::time(nullptr); }
  auto key() const { return std::tie(path, facts.device, facts.node, facts.size, facts.changed, facts.changed_ns); }

  std::string path;
  sys::FileFacts facts;
};

std::size_t count_of(const std::vector<long>& shape) {
  std::size_t count = 1;
  for (const long side : shape) count *= static_cast<std::size_t>(side);
  return count;
}

// Names the file's actual kind if it is known.
void refuse_another_kind(const std::string& path) {
  std::vector<unsigned char> begin;
  InputFile(path).read(4096, begin);
  const std::string_view text(reinterpret_cast<const char*>(begin.data()), begin.size());
  const auto other = what_file_is(path, text);
  if (!other || text.starts_with("\x89HDF")) return;
  fail(Status::format, "{}: {}", path, other->where("an HDF5 file"));
}

}  // namespace

struct Hdf5File::Session {
  explicit Session(const Identity& of) : identity(of), reader(of.path, Kind::hdf5, "its external link to") {
    reader.ask(Kind::hdf5, Packer().text(of.path));
    expect(Kind::done, 0);
  }
  Message expect(Kind kind, std::size_t most) {
    Message out = reader.next(most);
    if (out.kind != kind) reader.senseless("another message than the one expected");
    return out;
  }
  template <class F>
  auto unpacked(const Message& message, F&& take) {
    try {
      Unpacker in(message.body);
      auto out = take(in);
      in.end();
      return out;
    } catch (const read::BadMessage& e) {
      reader.senseless(e.what());
    }
  }
  template <class T>
  std::vector<T> values(Kind kind, const std::string& dataset, const std::vector<long>& shape);

  Identity identity;
  Reader reader;
};

// Readers of closed files, kept for reopening: a training opens a file for each picture.
class Hdf5File::Idle {
 public:
  // Never destroyed; the reader processes end with this process.
  static Idle& all() {
    static Idle& one = *new Idle;
    return one;
  }
  std::unique_ptr<Session> take(const Identity& of) {
    const std::lock_guard lock(mutex_);
    const auto at =
        std::find_if(sessions_.begin(), sessions_.end(), [&](const auto& s) { return s->identity.key() == of.key(); });
    if (at == sessions_.end()) return nullptr;
    std::unique_ptr<Session> out = std::move(*at);
    sessions_.erase(at);
    return out;
  }
  void put(std::unique_ptr<Session> session) {
    std::unique_ptr<Session> oldest;  // destroyed after the lock is released
    const std::lock_guard lock(mutex_);
    sessions_.push_front(std::move(session));
    if (sessions_.size() <= most_idle) return;
    oldest = std::move(sessions_.back());
    sessions_.pop_back();
  }

 private:
  std::mutex mutex_;
  std::list<std::unique_ptr<Session>> sessions_;  // newest first
};

std::string shape_text(const std::vector<long>& shape) {
  if (shape.empty()) return "a single value";
  std::string out;
  for (const long side : shape) out += (out.empty() ? "" : " x ") + std::to_string(side);
  return out;
}

Hdf5File::Hdf5File(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) fail(Status::file, "{}: no such file", path);
  const Identity of(path);
  session_ = Idle::all().take(of);
  if (session_) return;
  try {
    session_ = std::make_unique<Session>(of);
  } catch (const Error& e) {
    if (e.status() == Status::format) refuse_another_kind(path);
    throw;
  }
}

Hdf5File::~Hdf5File() {
  if (session_ && !session_->reader.ended() && session_->identity.settled()) Idle::all().put(std::move(session_));
}

std::vector<Hdf5File::Link> Hdf5File::links(const std::string& group) const {
  session_->reader.ask(Kind::links, Packer().text(group));
  const Message listed = session_->expect(Kind::listed, std::size_t{64} << 20);
  return session_->unpacked(listed, [](Unpacker& in) {
    std::vector<Link> out;
    for (auto left = in.get<std::uint32_t>(); left > 0; --left) {
      std::string name = in.text(1 << 16);
      out.push_back({std::move(name), in.text(1 << 16)});
    }
    return out;
  });
}

std::vector<long> Hdf5File::shape(const std::string& dataset) const {
  session_->reader.ask(Kind::shape, Packer().text(dataset));
  return session_->unpacked(session_->expect(Kind::values, 1024), [](Unpacker& in) { return in.shape(); });
}

// Reads into memory of the size that the shape implies; the reader has checked the shape.
template <class T>
std::vector<T> Hdf5File::Session::values(Kind kind, const std::string& dataset, const std::vector<long>& shape) {
  const std::size_t size = count_of(shape) * sizeof(T);
  reader.ask(kind, Packer().text(dataset).shape(shape), size);
  const read::Header header = reader.next_header(size);
  if (header.kind != Kind::values || header.size != size) reader.senseless("another message than the one expected");
  std::vector<T> out;
  try {
    out.resize(count_of(shape));
  } catch (const std::exception&) {  // bad_alloc, length_error
    reader.give_up(Status::memory,
                   fmt::format("{}: not enough host memory for its {} values", printable(dataset), shape_text(shape)));
  }
  reader.body(out.data(), size);
  return out;
}

std::vector<std::uint8_t> Hdf5File::bytes(const std::string& dataset, const std::vector<long>& shape) const {
  return session_->values<std::uint8_t>(Kind::bytes, dataset, shape);
}

std::vector<double> Hdf5File::numbers(const std::string& dataset, const std::vector<long>& shape) const {
  return session_->values<double>(Kind::numbers, dataset, shape);
}

}  // namespace vsplat
