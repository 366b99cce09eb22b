// Removes names of people and machines from text that others will see.
#pragma once
#include <string>
#include <utility>
#include <vector>

namespace vsplat {

struct Personal {
  std::vector<std::string> homes;  // home folders, replaced by ~
  std::vector<std::string> users;  // user names, replaced by USER where they are whole words
  std::vector<std::string> hosts;  // host names, replaced by HOST in the same way
};
// The names of the user who runs this process and of this machine, from the environment and the system's list of users.
// root is not personal.
Personal personal_here();

// Replaces folders only, including other users' /home/NAME and /Users/NAME. Names are kept: a name can be a part of a
// fact, as the user name debian is of "3.1+debian".
std::string without_homes(const std::string& text, const Personal& who);
// Replaces folders and names.
std::string without_personal(const std::string& text, const Personal& who);

}  // namespace vsplat
