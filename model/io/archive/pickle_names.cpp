#include "model/io/archive/pickle_names.h"

#include <algorithm>
#include <iterator>

namespace vsplat::pickle {
namespace {

struct OpcodeName {
  std::uint8_t opcode;
  const char* name;
};

constexpr OpcodeName kOpcodes[] = {{'(', "MARK"},          {')', "EMPTY_TUPLE"},
                                   {'.', "STOP"},          {'0', "POP"},
                                   {'1', "POP_MARK"},      {'2', "DUP"},
                                   {'B', "BINBYTES"},      {'C', "SHORT_BINBYTES"},
                                   {'F', "FLOAT"},         {'G', "BINFLOAT"},
                                   {'I', "INT"},           {'J', "BININT"},
                                   {'K', "BININT1"},       {'L', "LONG"},
                                   {'M', "BININT2"},       {'N', "NONE"},
                                   {'P', "PERSID"},        {'Q', "BINPERSID"},
                                   {'R', "REDUCE"},        {'S', "STRING"},
                                   {'T', "BINSTRING"},     {'U', "SHORT_BINSTRING"},
                                   {'V', "UNICODE"},       {'X', "BINUNICODE"},
                                   {']', "EMPTY_LIST"},    {'a', "APPEND"},
                                   {'b', "BUILD"},         {'c', "GLOBAL"},
                                   {'d', "DICT"},          {'e', "APPENDS"},
                                   {'g', "GET"},           {'h', "BINGET"},
                                   {'i', "INST"},          {'j', "LONG_BINGET"},
                                   {'l', "LIST"},          {'o', "OBJ"},
                                   {'p', "PUT"},           {'q', "BINPUT"},
                                   {'r', "LONG_BINPUT"},   {'s', "SETITEM"},
                                   {'t', "TUPLE"},         {'u', "SETITEMS"},
                                   {'}', "EMPTY_DICT"},    {0x80, "PROTO"},
                                   {0x81, "NEWOBJ"},       {0x82, "EXT1"},
                                   {0x83, "EXT2"},         {0x84, "EXT4"},
                                   {0x85, "TUPLE1"},       {0x86, "TUPLE2"},
                                   {0x87, "TUPLE3"},       {0x88, "NEWTRUE"},
                                   {0x89, "NEWFALSE"},     {0x8a, "LONG1"},
                                   {0x8b, "LONG4"},        {0x8c, "SHORT_BINUNICODE"},
                                   {0x8d, "BINUNICODE8"},  {0x8e, "BINBYTES8"},
                                   {0x8f, "EMPTY_SET"},    {0x90, "ADDITEMS"},
                                   {0x91, "FROZENSET"},    {0x92, "NEWOBJ_EX"},
                                   {0x93, "STACK_GLOBAL"}, {0x94, "MEMOIZE"},
                                   {0x95, "FRAME"},        {0x96, "BYTEARRAY8"},
                                   {0x97, "NEXT_BUFFER"},  {0x98, "READONLY_BUFFER"}};

// A list of allowed names on purpose: a list of dangerous ones would never be complete. The inert globals occur in
// optimisers, schedulers and callbacks of Lightning checkpoints; since nothing is called, they only become names.
constexpr KnownGlobal kGlobals[] = {{"collections OrderedDict", Global::ordered_dict},
                                    {"torch._utils _rebuild_tensor_v2", Global::rebuild_tensor},
                                    {"torch._utils _rebuild_parameter", Global::rebuild_parameter},
                                    {"torch DoubleStorage", Global::storage, Dtype::f64},
                                    {"torch FloatStorage", Global::storage, Dtype::f32},
                                    {"torch HalfStorage", Global::storage, Dtype::f16},
                                    {"torch BFloat16Storage", Global::storage, Dtype::bf16},
                                    {"torch LongStorage", Global::storage, Dtype::i64},
                                    {"torch IntStorage", Global::storage, Dtype::i32},
                                    {"torch ShortStorage", Global::storage, Dtype::i16},
                                    {"torch CharStorage", Global::storage, Dtype::i8},
                                    {"torch ByteStorage", Global::storage, Dtype::u8},
                                    {"torch BoolStorage", Global::storage, Dtype::boolean},
                                    {"collections defaultdict"},
                                    {"__builtin__ dict"},
                                    {"__builtin__ float"},
                                    {"__builtin__ int"},
                                    {"__builtin__ list"},
                                    {"__builtin__ long"},
                                    {"__builtin__ set"},
                                    {"_codecs encode"},
                                    {"numpy dtype"},
                                    {"numpy ndarray"},
                                    {"numpy.core.multiarray _reconstruct"},
                                    {"numpy.core.multiarray scalar"},
                                    {"pathlib PosixPath"},
                                    {"torch Size"},
                                    {"torch bfloat16"},
                                    {"torch device"},
                                    {"torch float16"},
                                    {"torch float32"},
                                    {"torch float64"},
                                    {"torch int64"}};

}  // namespace

const char* opcode_name(std::uint8_t opcode) {
  const auto* found = std::find_if(std::begin(kOpcodes), std::end(kOpcodes),
                                   [opcode](const OpcodeName& known) { return known.opcode == opcode; });
  return found == std::end(kOpcodes) ? nullptr : found->name;
}

const KnownGlobal* known_global(std::string_view name) {
  const auto* found = std::find_if(std::begin(kGlobals), std::end(kGlobals),
                                   [name](const KnownGlobal& known) { return known.name == name; });
  return found == std::end(kGlobals) ? nullptr : found;
}

}  // namespace vsplat::pickle
