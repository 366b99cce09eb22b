// What names a person or a machine, taken out of text that others get to see.
#pragma once
#include <string>
#include <utility>
#include <vector>

namespace vsplat {

struct Personal {
  std::vector<std::string> homes;  // folders, which become ~
  std::vector<std::string> users;  // names, which become USER where they stand alone
  std::vector<std::string> hosts;  // the same with HOST
};
// Of who runs this process, by the environment and the system's list of users. root is nobody's name.
Personal personal_here();

// Folders alone, other users' /home/NAME and /Users/NAME, too: a name by itself may be a part of a fact, as a user
// debian is of "3.1+debian".
std::string without_homes(const std::string& text, const Personal& who);
// And names.
std::string without_personal(const std::string& text, const Personal& who);

}  // namespace vsplat
