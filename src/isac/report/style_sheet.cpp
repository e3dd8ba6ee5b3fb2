#include "isac/report/document.hpp"

namespace isac::report {

const char* style_sheet() noexcept {
  return R"css(
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: #1b1b1b; font: 15px/1.5 Helvetica, Arial, "Liberation Sans", "DejaVu Sans", sans-serif; }
main { max-width: 860px; margin: 0 auto; padding: 40px 32px 64px; }
h1 { font-size: 27px; line-height: 1.2; margin: 0 0 4px; font-weight: 600; letter-spacing: -0.01em; }
h2 { font-size: 19px; margin: 40px 0 10px; padding-bottom: 4px; border-bottom: 1px solid #d5d5d5; font-weight: 600; }
h3 { font-size: 15.5px; margin: 26px 0 6px; font-weight: 600; }
p { margin: 8px 0; max-width: 76ch; }
ul { margin: 6px 0; padding-left: 20px; } li { margin: 3px 0; }
code { font: 0.93em "DejaVu Sans Mono", "Liberation Mono", monospace; background: #eef1f4; padding: 0 3px; border-radius: 2px; }
.subtitle { color: #555; margin: 0 0 20px; }
.equation { margin: 14px 0; padding: 12px 18px; border-left: 3px solid #0072b2; background: #f6f8fa; font: 16.5px/1.75 "STIX Two Text", "Times New Roman", "Liberation Serif", "DejaVu Serif", serif; overflow-x: auto; }
.equation div:not(:first-child) { font-size: 15px; color: #333; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(130px, 1fr)); gap: 10px; margin: 16px 0; }
.cards.halves { grid-template-columns: repeat(auto-fill, minmax(230px, 1fr)); }
.card { border: 1px solid #dcdcdc; border-radius: 4px; padding: 10px 14px; }
.card .label { font-size: 12.5px; color: #555; }
.card .value { font-size: 17.5px; font-weight: 600; font-variant-numeric: tabular-nums; white-space: nowrap; }
.card .note { font-size: 12.5px; color: #555; }
.scroll { overflow-x: auto; margin: 14px 0; }
table { border-collapse: collapse; font-size: 13.5px; font-variant-numeric: tabular-nums lining-nums; }
caption { text-align: left; padding-bottom: 6px; font-size: 13.5px; color: #333; }
caption b, figcaption b { font-weight: 600; }
thead th { border-top: 1.5px solid #222; border-bottom: 1px solid #222; font-weight: 600; text-align: left; padding: 5px 12px 5px 0; vertical-align: bottom; }
tbody td { padding: 3px 12px 3px 0; vertical-align: top; }
tbody tr:last-child td { border-bottom: 1.5px solid #222; }
tbody tr + tr td { border-top: 1px solid #ececec; }
th.n, td.n { text-align: right; padding-left: 12px; }
tbody td { white-space: nowrap; } td.w { white-space: normal; min-width: 16em; } td.b { white-space: normal; min-width: 10em; }
tr.set-off td { background: #fff7e6; }
table.correlation td, table.correlation th { padding: 4px 10px; text-align: right; border: 0; }
table.correlation tbody th { font-weight: 600; text-align: left; }
.box { border: 1px solid; border-left-width: 4px; border-radius: 3px; padding: 10px 16px; margin: 16px 0; }
.box .title { font-weight: 600; margin-bottom: 2px; }
.box.note { border-color: #b9c6d3; background: #f6f8fa; }
.box.good { border-color: #8cc9b0; background: #f2faf6; }
.box.warning { border-color: #e0b050; background: #fff9ec; }
.box.next { border-color: #7fb0d6; background: #f1f7fc; }
figure { margin: 20px 0 26px; }
figure svg { display: block; width: 100%; height: auto; max-width: 796px; }
figcaption { font-size: 13.5px; color: #333; max-width: 84ch; margin-top: 4px; }
footer { margin-top: 48px; border-top: 1px solid #d5d5d5; padding-top: 8px; font-size: 12.5px; color: #666; }
@media print {
  @page { margin: 18mm 16mm; }
  body { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  figure, .box, .card, tr { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
  .scroll, .equation { overflow: visible; }
  .equation, .box, tr.set-off td, table.correlation td { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
)css";
}

}  // namespace isac::report
