// Processes that work together, each with devices of its own, as mpirun starts them: ranks. What they say to each other
// goes through MPI, which is loaded where there are several, from a module of its own (runtime/system/mpi_module.cpp), so that
// nothing else needs it.
#pragma once
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace vsplat {

// One thread of a process at a time, the first time the one that will use it.
class Ranks {
 public:
  // The process's, which joins the others at the first call: alone where mpirun did not start it, or started one.
  // Error(usage) where it is one of several and the library was built without MPI: each would do all of the work.
  static Ranks& world();

  int rank() const { return rank_; }
  int count() const { return count_; }

  using Bytes = std::vector<unsigned char>;
  // In order, and whole; waits until it may go on with `bytes`.
  void send(int to, const Bytes& bytes);
  Bytes receive(int from);
  // What rank 0 gives, all get.
  void broadcast(Bytes& bytes);
  // Ends all of them, this one with that exit code: for whoever cannot go on while others wait for it.
  void abort(int code);

 private:
  Ranks();
  void send_piece(int to, const void* data, std::size_t size);
  void receive_piece(int from, void* data, std::size_t size);

  int rank_ = 0, count_ = 1;
  void* module_ = nullptr;
};

// What goes into messages, one behind the other, and comes out in the same order.
class MessageOut {
 public:
  template <class T>
  MessageOut& add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    return raw(&value, sizeof value);
  }
  MessageOut& add(const std::string& text) { return add<std::uint64_t>(text.size()).raw(text.data(), text.size()); }
  MessageOut& add(const std::vector<float>& values) {
    return add<std::uint64_t>(values.size()).raw(values.data(), values.size() * sizeof(float));
  }
  Ranks::Bytes& bytes() { return bytes_; }

 private:
  MessageOut& raw(const void* data, std::size_t size) {
    const auto* from = static_cast<const unsigned char*>(data);
    bytes_.insert(bytes_.end(), from, from + size);
    return *this;
  }
  Ranks::Bytes bytes_;
};

// Error(internal) where less is there than is asked for.
class MessageIn {
 public:
  explicit MessageIn(Ranks::Bytes bytes) : bytes_(std::move(bytes)) {}

  template <class T>
  T take() {
    static_assert(std::is_trivially_copyable_v<T>);
    T out;
    raw(&out, sizeof out);
    return out;
  }
  std::string take_text() {
    std::string out(size_of(1), '\0');
    raw(out.data(), out.size());
    return out;
  }
  std::vector<float> take_floats() {
    std::vector<float> out(size_of(sizeof(float)));
    raw(out.data(), out.size() * sizeof(float));
    return out;
  }

 private:
  std::size_t size_of(std::size_t element);
  void raw(void* out, std::size_t size);

  Ranks::Bytes bytes_;
  std::size_t at_ = 0;
};

}  // namespace vsplat
