// Interface for the cases of a self-test: a device, functions that compare results with expectations, and the kernels
// involved.
#pragma once
#include <algorithm>
#include <functional>
#include <initializer_list>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "model/diagnose/selftest/inputs/random_values.h"
#include "runtime/context.h"

namespace vsplat::selftest {

// One comparison of a result with its expectation. `kernels`: those launched since the previous result (or that one's,
// if none were), and those that keep() recorded; one of them caused the error.
struct Finding {
  std::string what;                  // "rope: turned"
  std::vector<NamedKernel> kernels;  // in alphabetical order
  double error = 0;  // largest difference relative to the largest value; infinite if values are not finite
  double tolerance = 0;
  bool right = true;
  bool zeros = false;   // all expected floats are 0
  std::string trouble;  // other problems: an error of the device, or different bits in the second run
};

// How many of a case's sizes are run: some of them, those of a self-test, or also those of the tests.
enum class Sizes { quick, selftest, all };

// A case runs twice; the second run must give the same bits. The context must outlive the checks and is meanwhile used
// for nothing else.
class Checks {
 public:
  Checks(Context& context, Sizes sizes);
  ~Checks();
  Checks(const Checks&) = delete;
  Checks& operator=(const Checks&) = delete;

  Context& ctx;
  const bool quick, all;  // the sizes

  // Runs the case twice. Errors that may be the device's fault become findings; others are thrown
  // (tells_of_the_device()).
  void run(const std::string& name, const std::function<void(Checks&)>& work);

  // Compares a device's floats with values, or with a function that computes them (called once).
  template <class Want>
  void close(const char* what, const Tensor& got, const Want& want, double tolerance) {
    close(what, ctx.read<float>(got), want, tolerance);
  }
  template <class Want>
  void close(const char* what, const std::vector<float>& got, const Want& want, double tolerance) {
    if (begins(what, got.data(), got.size() * sizeof(float))) compare(got, doubles_of(want), tolerance);
  }
  // The same for rows with values of different kinds: each kind relative to its own largest value.
  template <class Want>
  void close_by_column(const char* what, const std::vector<float>& got, std::size_t columns, const Want& want,
                       double tolerance) {
    if (begins(what, got.data(), got.size() * sizeof(float)))
      compare_columns(got, columns, doubles_of(want), tolerance);
  }
  // Requires exactly these values.
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
  // A statement that is true or false, about bits that must repeat.
  void that(const char* what, bool right, double error = 0, double tolerance = 0);

  // Adds the kernels launched since the last result to all further results of the case: they made its inputs, which are
  // not checked by themselves.
  void keep();

  // All of these sizes, or in a quick test a subset: the first, every third and the last. `more`: only in the tests.
  template <class T>
  std::vector<T> some(std::initializer_list<T> sizes, std::initializer_list<T> more = {}) const {
    std::vector<T> out;
    std::size_t i = 0;
    for (const T& one : sizes) {
      if (!quick || i % 3 == 0 || i + 1 == sizes.size()) out.push_back(one);
      ++i;
    }
    if (all) out.insert(out.end(), more.begin(), more.end());
    return out;
  }

  // What is allowed of any device; and of those that the tests run on.
  double within(double any, double tested) const { return all ? tested : any; }

  Tensor up(const Shape& shape, const std::vector<float>& x) { return ctx.upload(shape, x); }
  Tensor up(const Shape& shape, const std::vector<int>& x) { return ctx.upload(shape, x, Type::i32); }
  Tensor up(const Shape& shape, const std::vector<std::uint32_t>& x) { return ctx.upload(shape, x, Type::u32); }
  // Fills with NaN, which must be overwritten.
  Tensor gap(const Shape& shape);
  Tensor zeros(const Shape& shape);

  const std::vector<Finding>& findings() const { return findings_; }
  const std::set<NamedKernel>& launched() const { return launched_; }  // in total

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
  std::size_t first_ = 0, at_ = 0;  // findings of this case: the first one, and the next one
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
