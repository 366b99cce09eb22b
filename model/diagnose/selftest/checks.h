// What a case of a self-test is given: a device, a way to say what should have come of it, and which kernels it was.
#pragma once
#include <algorithm>
#include <functional>
#include <initializer_list>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "model/diagnose/selftest/inputs/random.h"
#include "runtime/context.h"

namespace vsplat::selftest {

// One result held against what it should be. The kernels are those launched since the result before (where there are
// none, they are that one's), and what was kept: the error is of one of them.
struct Finding {
  std::string what;                  // "rope: turned"
  std::vector<NamedKernel> kernels;  // in alphabetical order
  double error = 0;                  // the largest difference by the largest value; infinite where numbers are none
  double tolerance = 0;
  bool right = true;
  std::string trouble;  // what else is wrong: an error of the device, other bits the second time
};

// A case is run twice: the second time its results are to have the same bits. The context outlives its checks, and is
// used for nothing else.
class Checks {
 public:
  Checks(Context& context, bool quick);
  Checks(const Checks&) = delete;
  Checks& operator=(const Checks&) = delete;

  Context& ctx;
  const bool quick;

  // Runs it, both times. Errors that the device may be to blame for are findings; others pass (tells_of_the_device()).
  void run(const std::string& name, const std::function<void(Checks&)>& work);

  // A device's floats against numbers, or what makes them (it is called once).
  template <class Want>
  void close(const char* what, const Tensor& got, const Want& want, double tolerance) {
    close(what, ctx.read<float>(got), want, tolerance);
  }
  template <class Want>
  void close(const char* what, const std::vector<float>& got, const Want& want, double tolerance) {
    if (begins(what, got.data(), got.size() * sizeof(float))) compare(got, doubles_of(want), tolerance);
  }
  // The same for rows of so many numbers of different kinds: each kind by its own largest value.
  template <class Want>
  void close_by_column(const char* what, const std::vector<float>& got, std::size_t columns, const Want& want,
                       double tolerance) {
    if (begins(what, got.data(), got.size() * sizeof(float)))
      compare_columns(got, columns, doubles_of(want), tolerance);
  }
  // Exactly these.
  template <class T>
  void equal(const char* what, const Tensor& got, const std::vector<T>& want) {
    equal(what, ctx.read<T>(got), want);
  }
  template <class T>
  void equal(const char* what, const std::vector<T>& got, const std::vector<T>& want) {
    if (!begins(what, got.data(), got.size() * sizeof(T))) return;
    std::size_t wrong = got.size() == want.size() ? 0 : std::max(got.size(), want.size());
    for (std::size_t i = 0; wrong == 0 && i < got.size(); ++i) wrong += !(got[i] == want[i]);
    ends(got.empty() ? 0.0 : static_cast<double>(wrong) / static_cast<double>(got.size()), 0, wrong == 0);
  }
  // A statement that is right or wrong, of bits that are to be the same again.
  void that(const char* what, bool right, double error = 0, double tolerance = 0);

  // From now on, to the end of the case, whatever was launched for the last result and since has a part in all results:
  // what they are made from, and is not looked at by itself.
  void keep();

  // Of these sizes all, or in a quick test some: the first, every third and the last.
  template <class T>
  std::vector<T> some(std::initializer_list<T> all) const {
    std::vector<T> out;
    std::size_t i = 0;
    for (const T& one : all) {
      if (!quick || i % 3 == 0 || i + 1 == all.size()) out.push_back(one);
      ++i;
    }
    return out;
  }

  Tensor up(const Shape& shape, const std::vector<float>& x) { return ctx.upload(shape, x); }
  Tensor up(const Shape& shape, const std::vector<int>& x) { return ctx.upload(shape, x, Type::i32); }
  Tensor up(const Shape& shape, const std::vector<std::uint32_t>& x) { return ctx.upload(shape, x, Type::u32); }
  // Nothing but NaN, which is to be overwritten.
  Tensor gap(const Shape& shape);
  Tensor zeros(const Shape& shape);

  const std::vector<Finding>& findings() const { return findings_; }
  const std::set<NamedKernel>& launched() const { return launched_; }  // in all

 private:
  template <class Want>
  static std::vector<double> doubles_of(const Want& want) {
    if constexpr (std::is_invocable_v<Want>)
      return doubles_of(want());
    else
      return std::vector<double>(want.begin(), want.end());
  }
  bool begins(const char* what, const void* bits, std::size_t bytes);
  void ends(double error, double tolerance, bool right);
  void compare(const std::vector<float>& got, const std::vector<double>& want, double tolerance);
  void compare_columns(const std::vector<float>& got, std::size_t columns, const std::vector<double>& want,
                       double tolerance);
  std::vector<NamedKernel> take_kernels();

  std::string name_;
  bool again_ = false;
  std::size_t first_ = 0, at_ = 0;  // findings of this case: where they begin, and the next one
  std::vector<Finding> findings_;
  std::vector<std::string> digests_;
  NotedKernels noted_;
  std::set<NamedKernel> launched_, kept_;
};

struct Case {
  const char* name;  // of an operation
  void (*run)(Checks& c);
};

}  // namespace vsplat::selftest
