#include "embedded.hpp"

// The assembler embeds the files as they are; a C++ string literal would have to be split, and would compile slowly.
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
