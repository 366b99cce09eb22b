#include "runtime/kernel_files.h"

#include <algorithm>
#include <cctype>
#include <sstream>

#include "runtime/program.h"

namespace vsplat {
namespace {

constexpr const char* kAllowed = "allowed.txt";

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

bool in_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

std::size_t skip_blanks(const std::string& text, std::size_t at) {
  while (at < text.size() && std::isspace(static_cast<unsigned char>(text[at]))) ++at;
  return at;
}

// The position after any "__attribute__((...))" at `at`, and after macros, which are in capitals.
std::size_t skip_attributes(const std::string& text, std::size_t at) {
  const std::string word = "__attribute__";
  for (;;) {
    if (at < text.size() && std::isupper(static_cast<unsigned char>(text[at]))) {
      while (at < text.size() && in_word(text[at])) ++at;
      at = skip_blanks(text, at);
      continue;
    }
    if (text.compare(at, word.size(), word) != 0) return at;
    at = skip_blanks(text, at + word.size());
    int depth = 0;
    do {
      if (at >= text.size()) return at;
      depth += text[at] == '(' ? 1 : text[at] == ')' ? -1 : 0;
      ++at;
    } while (depth > 0);
    at = skip_blanks(text, at);
  }
}

std::string without_comments(const std::string& text) {
  std::string out, line;
  std::istringstream lines(text);
  while (std::getline(lines, line)) out += line.substr(0, line.find("//")) + "\n";
  return out;
}

std::vector<std::string> kernels_in(const std::string& source) {
  const std::string text = without_comments(source), word = "kernel";
  std::vector<std::string> out;
  for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos;) {
    const bool begins = at == 0 || !in_word(text[at - 1]);
    at += word.size();
    if (!begins || (at < text.size() && in_word(text[at]))) continue;
    std::size_t next = skip_attributes(text, skip_blanks(text, at));
    if (text.compare(next, 4, "void") != 0) continue;
    next = skip_blanks(text, next + 4);
    const std::size_t from = next;
    while (next < text.size() && in_word(text[next])) ++next;
    if (next > from) out.push_back(text.substr(from, next - from));
  }
  return out;
}

// The words after "// <key>:" on a line of its own.
std::vector<std::string> marked(const std::string& text, const std::string& key) {
  std::vector<std::string> out;
  std::istringstream lines(text);
  const std::string start = "// " + key + ":";
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(start, 0) != 0) continue;
    std::string rest = line.substr(start.size());
    std::replace(rest.begin(), rest.end(), ',', ' ');
    std::istringstream words(rest);
    for (std::string w; words >> w;) out.push_back(w);
  }
  return out;
}

}  // namespace

std::vector<KernelFile> kernel_files() {
  std::vector<KernelFile> out;
  for (const std::string& name : kernel_file_names()) {
    if (!ends_with(name, ".cl")) continue;
    const std::string text = kernel_text(name);
    KernelFile file;
    file.name = name.substr(0, name.size() - 3);
    file.kernels = kernels_in(text);
    file.targets = marked(text, "targets");
    file.cpu_alone = marked(text, "flavour") == std::vector<std::string>{"cpu"};
    out.push_back(std::move(file));
  }
  return out;
}

bool is_of_cpu(const KernelFile& file, const std::string& kernel) {
  if (ends_with(kernel, "_cpu")) return true;
  if (ends_with(kernel, "_gpu")) return false;
  return !ends_with(file.name, "_gpu");
}

bool is_of_gpu(const KernelFile& file, const std::string& kernel) {
  if (ends_with(kernel, "_gpu")) return true;
  if (ends_with(kernel, "_cpu") || file.cpu_alone) return false;
  return !ends_with(file.name, "_cpu");
}

std::string allowed_scratch() {
  const std::vector<std::string> names = kernel_file_names();
  return std::find(names.begin(), names.end(), kAllowed) == names.end() ? "" : kernel_text(kAllowed);
}

}  // namespace vsplat
