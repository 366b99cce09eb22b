#include "model/io/archive/pickle.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "model/io/archive/pickle_names.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat::pickle {
namespace {

constexpr int kProtocol = 2;  // what torch.save writes
constexpr std::size_t kMostSides = 16;
constexpr std::size_t kMostPushed = 4 * most_values;

const char* called(Kind kind) {
  constexpr const char* names[] = {"None",   "a truth value", "an integer", "a number",  "a text",   "a tuple",
                                   "a list", "a dict",        "a global",   "a storage", "a tensor", "an object"};
  return names[static_cast<std::size_t>(kind)];
}

class Reader {
 public:
  Reader(const std::string& what, std::span<const unsigned char> bytes) : what_(what), bytes_(bytes) {}

  Pickle read() {
    while (step()) {
    }
    if (at_ != bytes_.size()) bad(fmt::format("{} bytes follow the end", bytes_.size() - at_));
    return std::move(out_);
  }

 private:
  // ------------------------------------------------------------------------------------------------------------ bytes
  [[noreturn]] void bad(const std::string& problem) const {
    fail(Status::format, "{}, byte {}: {}", what_, begin_, problem);
  }

  std::span<const unsigned char> take(std::uint64_t count) {
    if (count > bytes_.size() - at_)
      bad(fmt::format("{} more bytes are expected and {} are there: it is cut off, or no pickle", count,
                      bytes_.size() - at_));
    const auto out = bytes_.subspan(at_, static_cast<std::size_t>(count));
    at_ += out.size();
    return out;
  }
  std::uint32_t number(std::size_t bytes) {
    std::uint32_t out = 0;
    const auto from = take(bytes);
    for (std::size_t i = 0; i < bytes; ++i) out |= static_cast<std::uint32_t>(from[i]) << 8 * i;
    return out;
  }
  std::string_view text(std::uint64_t count) {
    const auto from = take(count);
    return {reinterpret_cast<const char*>(from.data()), from.size()};
  }
  std::string_view line() {
    const auto rest = bytes_.subspan(at_);
    const auto end = std::find(rest.begin(), rest.end(), '\n');
    if (end == rest.end()) bad("a name without an end: it is cut off");
    const std::string_view out = text(static_cast<std::uint64_t>(end - rest.begin()));
    ++at_;
    return out;
  }

  // ------------------------------------------------------------------------------------------------------------ stack
  Ref make(Value value) {
    if (out_.values.size() >= most_values) bad(fmt::format("more than {} values", most_values));
    out_.values.push_back(std::move(value));
    return static_cast<Ref>(out_.values.size() - 1);
  }
  void push(Ref ref) {
    if (++pushed_ > kMostPushed) bad(fmt::format("more than {} uses of values", kMostPushed));
    stack_.push_back(ref);
  }
  void push(Value value) { push(make(std::move(value))); }
  std::size_t floor() const { return marks_.empty() ? 0 : marks_.back(); }
  Ref pop() {
    if (stack_.size() <= floor()) bad("takes a value where there is none");
    const Ref out = stack_.back();
    stack_.pop_back();
    return out;
  }
  std::vector<Ref> pop(std::size_t count) {
    if (stack_.size() - floor() < count) bad(fmt::format("takes {} values where there are fewer", count));
    std::vector<Ref> out(stack_.end() - static_cast<std::ptrdiff_t>(count), stack_.end());
    stack_.resize(stack_.size() - count);
    return out;
  }
  std::vector<Ref> pop_to_mark() {
    if (marks_.empty()) bad("goes back to a mark where there is none");
    std::vector<Ref> out = pop(stack_.size() - marks_.back());
    marks_.pop_back();
    return out;
  }
  Ref top() const {
    if (stack_.size() <= floor()) bad("looks at a value where there is none");
    return stack_.back();
  }

  void remember(std::size_t index) {
    const Ref value = top();
    if (index >= most_values) bad(fmt::format("stores a value as number {}, beyond {}", index, most_values));
    if (index >= memo_.size()) memo_.resize(index + 1, kNothing);
    memo_[index] = value;
  }
  void recall(std::size_t index) {
    if (index >= memo_.size() || memo_[index] == kNothing)
      bad(fmt::format("asks for number {}, which was not stored", index));
    push(memo_[index]);
  }

  // ------------------------------------------------------------------------------------------------------- containers
  void add(const std::vector<Ref>& items, Kind kind) {
    Value& to = out_.values[top()];
    if (to.kind == Kind::inert) return;
    if (to.kind != kind) bad(fmt::format("adds to {}, {} is expected", called(to.kind), called(kind)));
    if (kind == Kind::dict && items.size() % 2 != 0) bad("a key without a value");
    to.items.insert(to.items.end(), items.begin(), items.end());
  }
  void push_tuple(std::vector<Ref> items) {
    Value value;
    value.kind = Kind::tuple;
    value.items = std::move(items);
    push(std::move(value));
  }
  void push_empty(Kind kind) {
    Value value;
    value.kind = kind;
    push(std::move(value));
  }
  void push_integer(std::int64_t number, Kind kind = Kind::integer) {
    Value value;
    value.kind = kind;
    value.number = number;
    push(std::move(value));
  }
  void push_named(Kind kind, std::string_view text) {
    Value value;
    value.kind = kind;
    value.text = text;
    push(std::move(value));
  }
  void push_long() {
    const auto from = take(take(1)[0]);
    if (from.size() > 8) bad(fmt::format("an integer of {} bytes, at most 8 are expected", from.size()));
    std::uint64_t out = !from.empty() && from.back() >= 0x80 ? ~std::uint64_t{0} : 0;
    for (std::size_t i = from.size(); i-- > 0;) out = out << 8 | from[i];
    push_integer(static_cast<std::int64_t>(out));
  }

  // ------------------------------------------------------------------------------------------------- globals and calls
  void push_global() {
    const std::string_view module = line(), name = line();
    std::string both(module);
    both.append(1, ' ').append(name);
    const KnownGlobal* known = known_global(both);
    if (known == nullptr)
      bad(
          fmt::format("names \"{}\", which no state dict needs: refused. If you trust its makers, save the state dict "
                      "alone",
                      printable(both)));
    push_named(known->what == Global::inert ? Kind::inert : Kind::global, known->name);
  }

  void push_storage() {
    const Value& id = out_.at(pop());
    const auto is = [&](std::size_t i, Kind kind) { return out_.at(id.items[i]).kind == kind; };
    if (id.kind != Kind::tuple || id.items.size() != 5 || !is(0, Kind::text) || !is(1, Kind::global) ||
        !is(2, Kind::text) || !is(3, Kind::text) || !is(4, Kind::integer) || out_.at(id.items[0]).text != "storage")
      bad("a persistent id that is not (\"storage\", type, key, location, count)");
    const KnownGlobal* type = known_global(out_.at(id.items[1]).text);
    if (type == nullptr || type->what != Global::storage)
      bad(fmt::format("a storage of type \"{}\"", printable(out_.at(id.items[1]).text)));
    const std::string_view key = out_.at(id.items[2]).text;
    if (key.empty() || key.size() > 20 || key.find_first_not_of("0123456789") != std::string_view::npos)
      bad(fmt::format("a storage's key is \"{}\", decimal digits are expected", printable(key)));
    const std::int64_t count = out_.at(id.items[4]).number;
    if (count < 0 || count > std::numeric_limits<std::int64_t>::max() / 8)
      bad(fmt::format("a storage of {} elements", count));
    out_.storages.push_back({type->dtype, key, static_cast<std::uint64_t>(count)});
    push_integer(static_cast<std::int64_t>(out_.storages.size() - 1), Kind::storage);
  }

  std::vector<std::int64_t> sizes(Ref ref, const char* what) const {
    const Value& value = out_.at(ref);
    if (value.kind != Kind::tuple || value.items.size() > kMostSides)
      bad(fmt::format("a tensor's {} is {} of {}, a tuple of at most {} integers is expected", what, called(value.kind),
                      value.items.size(), kMostSides));
    std::vector<std::int64_t> out;
    for (const Ref item : value.items) {
      if (out_.at(item).kind != Kind::integer || out_.at(item).number < 0)
        bad(fmt::format("a tensor's {} holds something other than integers from 0", what));
      out.push_back(out_.at(item).number);
    }
    return out;
  }

  // Arguments: (storage, offset, size, stride, requires_grad, backward_hooks) and, for some tensors, metadata.
  void push_tensor(const Value& arguments) {
    const std::vector<Ref>& given = arguments.items;
    if (given.size() < 6 || given.size() > 7 || out_.at(given[0]).kind != Kind::storage ||
        out_.at(given[1]).kind != Kind::integer)
      bad("a tensor that is not made of a storage, an offset, a size and strides");
    Tensor tensor;
    tensor.storage = static_cast<std::size_t>(out_.at(given[0]).number);
    tensor.offset = out_.at(given[1]).number;
    const std::vector<std::int64_t> shape = sizes(given[2], "size");
    tensor.shape.assign(shape.begin(), shape.end());
    tensor.strides = sizes(given[3], "stride");
    check_inside(tensor);
    out_.tensors.push_back(std::move(tensor));
    push_integer(static_cast<std::int64_t>(out_.tensors.size() - 1), Kind::tensor);
  }

  void check_inside(const Tensor& tensor) const {
    if (tensor.strides.size() != tensor.shape.size())
      bad(fmt::format("a tensor with {} sides and {} strides", tensor.shape.size(), tensor.strides.size()));
    const std::uint64_t there = out_.storages[tensor.storage].count;
    std::uint64_t last = static_cast<std::uint64_t>(tensor.offset), elements = 8;
    bool beyond = tensor.offset < 0, empty = false;
    for (std::size_t i = 0; i < tensor.shape.size(); ++i) {
      const auto side = static_cast<std::uint64_t>(tensor.shape[i]);
      std::uint64_t reach = 0;
      empty = empty || side == 0;
      if (side == 0) continue;
      beyond = beyond || __builtin_mul_overflow(side - 1, static_cast<std::uint64_t>(tensor.strides[i]), &reach) ||
               __builtin_add_overflow(last, reach, &last) || __builtin_mul_overflow(elements, side, &elements);
    }
    if (beyond || elements > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) ||
        (!empty && last >= there))
      bad(fmt::format("a tensor of {} from element {} on reaches beyond its storage of {} elements",
                      printable(text_of(tensor.shape)), tensor.offset, there));
  }

  void call() {
    const Ref with = pop(), what = pop();
    const Value& arguments = out_.at(with);
    const Value& function = out_.at(what);
    if (arguments.kind != Kind::tuple) bad(fmt::format("a call with {}, a tuple is expected", called(arguments.kind)));
    if (function.kind == Kind::inert) return push_named(Kind::inert, function.text);
    const KnownGlobal* known = function.kind == Kind::global ? known_global(function.text) : nullptr;
    if (known != nullptr && known->what == Global::ordered_dict) {
      if (!arguments.items.empty()) bad("an OrderedDict that is made from arguments, an empty one is expected");
      return push_empty(Kind::dict);
    }
    if (known != nullptr && known->what == Global::rebuild_tensor) return push_tensor(arguments);
    if (known != nullptr && known->what == Global::rebuild_parameter) {  // (tensor, requires_grad, backward_hooks)
      if (arguments.items.size() != 3 || out_.at(arguments.items[0]).kind != Kind::tensor)
        bad("a parameter that is not made of a tensor");
      return push(arguments.items[0]);
    }
    bad(fmt::format("calls {} \"{}\": refused", called(function.kind), printable(function.text)));
  }

  // Sets an object's state, such as the `_metadata` of a state dict; the state is ignored.
  void build() {
    pop();
    const Kind kind = out_.at(top()).kind;
    if (kind != Kind::dict && kind != Kind::inert) bad(fmt::format("sets the state of {}: refused", called(kind)));
  }

  // -------------------------------------------------------------------------------------------------------------------
  void begin(std::uint8_t opcode) const {
    if (opcode != static_cast<std::uint8_t>(Opcode::proto))
      bad("does not begin with a protocol: no pickle of torch.save");
  }

  // Returns false at the end.
  bool step() {
    begin_ = at_;
    const std::uint8_t opcode = take(1)[0];
    if (begin_ == 0) begin(opcode);
    switch (static_cast<Opcode>(opcode)) {
      case Opcode::proto:
        if (const std::uint32_t protocol = number(1); protocol != kProtocol || begin_ != 0)
          bad(fmt::format("protocol {}, expected {}, and at the beginning", protocol, kProtocol));
        break;
      case Opcode::stop:
        if (!marks_.empty() || stack_.size() != 1)
          bad(fmt::format("ends with {} values, one is expected", stack_.size()));
        out_.root = pop();
        return false;
      case Opcode::mark:
        if (marks_.size() >= most_values) bad(fmt::format("more than {} marks", most_values));
        marks_.push_back(stack_.size());
        break;
      case Opcode::none:
        push_empty(Kind::none);
        break;
      case Opcode::new_true:
      case Opcode::new_false:
        push_integer(opcode == static_cast<std::uint8_t>(Opcode::new_true), Kind::boolean);
        break;
      case Opcode::bin_int:
        push_integer(static_cast<std::int32_t>(number(4)));
        break;
      case Opcode::bin_int1:
        push_integer(number(1));
        break;
      case Opcode::bin_int2:
        push_integer(number(2));
        break;
      case Opcode::long1:
        push_long();
        break;
      case Opcode::bin_float:
        take(8);
        push_empty(Kind::real);
        break;
      case Opcode::bin_unicode:
        push_named(Kind::text, text(number(4)));
        break;
      case Opcode::empty_tuple:
        push_empty(Kind::tuple);
        break;
      case Opcode::empty_list:
        push_empty(Kind::list);
        break;
      case Opcode::empty_dict:
        push_empty(Kind::dict);
        break;
      case Opcode::tuple:
        push_tuple(pop_to_mark());
        break;
      case Opcode::tuple1:
      case Opcode::tuple2:
      case Opcode::tuple3:
        push_tuple(pop(opcode - static_cast<std::size_t>(Opcode::tuple1) + 1));
        break;
      case Opcode::append:
        add(pop(1), Kind::list);
        break;
      case Opcode::appends:
        add(pop_to_mark(), Kind::list);
        break;
      case Opcode::set_item:
        add(pop(2), Kind::dict);
        break;
      case Opcode::set_items:
        add(pop_to_mark(), Kind::dict);
        break;
      case Opcode::bin_put:
        remember(number(1));
        break;
      case Opcode::long_bin_put:
        remember(number(4));
        break;
      case Opcode::bin_get:
        recall(number(1));
        break;
      case Opcode::long_bin_get:
        recall(number(4));
        break;
      case Opcode::global:
        push_global();
        break;
      case Opcode::bin_persid:
        push_storage();
        break;
      case Opcode::reduce:
        call();
        break;
      case Opcode::build:
        build();
        break;
      default:
        if (const char* name = opcode_name(opcode))
          bad(fmt::format("the opcode {}, which torch.save does not write for state dicts: refused", name));
        bad(fmt::format("{:#04x} is no opcode: it is damaged, or no pickle", opcode));
    }
    return true;
  }

  static constexpr Ref kNothing = std::numeric_limits<Ref>::max();

  const std::string& what_;
  std::span<const unsigned char> bytes_;
  std::size_t at_ = 0, begin_ = 0;  // read position; begin of the current opcode
  std::size_t pushed_ = 0;
  Pickle out_;
  std::vector<Ref> stack_, memo_;
  std::vector<std::size_t> marks_;
};

}  // namespace

std::uint64_t Tensor::count() const {
  std::uint64_t out = 1;
  for (const long side : shape) out *= static_cast<std::uint64_t>(side);
  return out;
}

Pickle read(const std::string& what, std::span<const unsigned char> bytes) { return Reader(what, bytes).read(); }

}  // namespace vsplat::pickle
