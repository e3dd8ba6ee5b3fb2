#include "counted_new.hpp"

#include <cstdlib>
#include <new>

namespace isac::test {

thread_local bool watched = false;
thread_local long allocations = 0;

void watch_allocations() noexcept {
  allocations = 0;
  watched = true;
}
long watched_allocations() noexcept {
  watched = false;
  return allocations;
}

}  // namespace isac::test

void* operator new(std::size_t size) {
  if (isac::test::watched) ++isac::test::allocations;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
