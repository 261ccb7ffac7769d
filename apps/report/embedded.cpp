#include "embedded.hpp"

// The assembler reads the files as they are; a text in C++ would have to be cut in pieces and take a compiler's time.
#define RHEC_EMBED(NAME, FILE)                                                   \
  __asm__(".pushsection .rodata\n" #NAME "_begin:\n.incbin \"" FILE "\"\n" #NAME \
          "_end:\n"                                                              \
          ".byte 0\n.popsection\n");                                             \
  extern "C" __attribute__((visibility("hidden"))) const char NAME##_begin[];    \
  extern "C" __attribute__((visibility("hidden"))) const char NAME##_end[]

RHEC_EMBED(rhec_report_page, RHEC_REPORT_PAGE);
RHEC_EMBED(rhec_report_figures, RHEC_REPORT_FIGURES);

namespace rhec::apps {

std::string_view embedded_page() { return {rhec_report_page_begin, rhec_report_page_end}; }
std::string_view embedded_figures() { return {rhec_report_figures_begin, rhec_report_figures_end}; }

}  // namespace rhec::apps
