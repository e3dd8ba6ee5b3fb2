#include "isac/core/units.hpp"

namespace isac {}
