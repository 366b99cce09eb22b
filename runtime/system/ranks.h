// Ranks: processes started by mpirun that work together, each with its own devices. They communicate through MPI, which
// is loaded only if there are several ranks, from a separate module (runtime/system/mpi_module.cpp), so that nothing
// else depends on MPI.
#pragma once
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace vsplat {

// Used by one thread of a process at a time; the first call must come from the thread that will use it.
class Ranks {
 public:
  // This process's object; the first call joins the other ranks. A process that mpirun did not start, or started alone,
  // is the only rank. Error(usage) if it is one of several and the library was built without MPI: otherwise each
  // process would do all of the work.
  static Ranks& world();

  int rank() const { return rank_; }
  int count() const { return count_; }

  using Bytes = std::vector<unsigned char>;
  // Sends a whole message; messages arrive in order. Returns when `bytes` may be reused.
  void send(int to, const Bytes& bytes);
  Bytes receive(int from);
  // Distributes rank 0's bytes to all ranks.
  void broadcast(Bytes& bytes);
  // Ends all ranks, this one with exit code `code`: for a rank that cannot continue while others wait for it.
  void abort(int code);

 private:
  Ranks();
  void send_piece(int to, const void* data, std::size_t size);
  void receive_piece(int from, void* data, std::size_t size);

  int rank_ = 0, count_ = 1;
  void* module_ = nullptr;
};

// Serialises values into a message, one after the other; MessageIn reads them in the same order.
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

// Error(internal) if the message is shorter than what is read.
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
