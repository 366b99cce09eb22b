#include "model/diagnose/personal.h"

#include <algorithm>
#include <cctype>

#include "runtime/system/environment.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

bool in_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; }

// Replaces `what` wherever it is not a part of a longer word; if it begins with a slash, it may begin within one.
std::string replaced(const std::string& text, const std::string& what, const std::string& by) {
  std::string out;
  std::size_t from = 0;
  for (std::size_t at; (at = text.find(what, from)) != std::string::npos;) {
    const std::size_t end = at + what.size();
    const bool begins = at == 0 || !in_word(text[at - 1]) || !in_word(what.front());
    const bool ends = end == text.size() || !in_word(text[end]);
    out.append(text, from, at - from);
    out += begins && ends ? by : what;
    from = end;
  }
  return out.append(text, from);
}

std::string without_folders_of(const std::string& text, const std::string& parent) {
  std::string out;
  std::size_t from = 0;
  for (std::size_t at; (at = text.find(parent, from)) != std::string::npos;) {
    const std::size_t name = at + parent.size();
    out.append(text, from, name - from);
    from = std::min(text.find_first_of("/:;,\"'` )\n\t", name), text.size());
    if (from > name) out += "USER";
  }
  return out.append(text, from);
}

void add(std::vector<std::string>& to, const std::string& name) {
  if (name.size() > 1 && name != "root" && name != "localhost" && std::find(to.begin(), to.end(), name) == to.end())
    to.push_back(name);
}

void add_home(std::vector<std::string>& to, std::string folder) {
  while (folder.ends_with('/')) folder.pop_back();
  if (folder.starts_with('/')) add(to, folder);
}

}  // namespace

Personal personal_here() {
  Personal out;
  add_home(out.homes, environment("HOME"));
  for (const char* name : {"USER", "LOGNAME", "SUDO_USER"}) add(out.users, environment(name));
  const sys::User user = sys::this_user();
  add_home(out.homes, user.home);
  add(out.users, user.name);
  const std::string host = sys::host_name();
  add(out.hosts, host);
  add(out.hosts, host.substr(0, host.find('.')));
  // Longer ones first: one may contain a shorter one.
  for (auto* all : {&out.homes, &out.users, &out.hosts})
    std::sort(all->begin(), all->end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return out;
}

std::string without_homes(const std::string& text, const Personal& who) {
  std::string out = text;
  for (const std::string& home : who.homes) out = replaced(out, home, "~");
  for (const char* parent : {"/home/", "/Users/"}) out = without_folders_of(out, parent);
  return out;
}

std::string without_personal(const std::string& text, const Personal& who) {
  std::string out = without_homes(text, who);
  for (const std::string& host : who.hosts) out = replaced(out, host, "HOST");
  for (const std::string& user : who.users) out = replaced(out, user, "USER");
  return out;
}

}  // namespace vsplat
