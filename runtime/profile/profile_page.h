// A profile as one page to look at, with all that it needs inside.
#pragma once
#include <string>

#include "runtime/profile/profile_text.h"

namespace vsplat {

// Of launches and spans the longest are in the timeline, some 20,000 of each.
std::string profile_page(const Profile& profile, const ProfileSubject& subject);

}  // namespace vsplat
