// The table of the friction laws, one row for each. A row has the same name as the law in Python
// (granpinn/physics/laws).
#pragma once

#include <string_view>

#include "cohesive.h"
#include "coulomb.h"
#include "free.h"
#include "mu_of_i.h"
#include "power.h"
#include "regularised.h"

#define GRANPINN_LAWS(ROW)      \
  ROW(mu_of_i, MuOfI)           \
  ROW(coulomb, Coulomb)         \
  ROW(regularised, Regularised) \
  ROW(power, Power)             \
  ROW(cohesive, Cohesive)       \
  ROW(free, Free)

namespace granpinn {

enum class LawName {
#define GRANPINN_ROW(name, Law) name,
  GRANPINN_LAWS(GRANPINN_ROW)
#undef GRANPINN_ROW
};

constexpr int larger(int a, int b) { return a < b ? b : a; }

// The largest number of parameters of a law: arrays of parameters have this length.
#define GRANPINN_ROW(name, Law) larger(Law::parameters,
#define GRANPINN_CLOSE(name, Law) )
constexpr int kMaxLawParameters = GRANPINN_LAWS(GRANPINN_ROW) 0 GRANPINN_LAWS(GRANPINN_CLOSE);
#undef GRANPINN_ROW
#undef GRANPINN_CLOSE

// Calls work(Law{}) for the law of that name.
template <class Work>
GRANPINN_HD auto visit_law(LawName name, const Work& work) {
#define GRANPINN_ROW(row, Law) \
  if (name == LawName::row) return work(Law{});
  GRANPINN_LAWS(GRANPINN_ROW)
#undef GRANPINN_ROW
  return work(MuOfI{});  // not reached: every name has a row
}

// The law called `name`, on the host; false for an unknown name.
inline bool law_named(std::string_view name, LawName* found) {
#define GRANPINN_ROW(row, Law) \
  if (name == Law::name) return *found = LawName::row, true;
  GRANPINN_LAWS(GRANPINN_ROW)
#undef GRANPINN_ROW
  return false;
}

GRANPINN_HD int parameters_of(LawName name) {
  return visit_law(name, [](auto law) { return decltype(law)::parameters; });
}

}  // namespace granpinn
