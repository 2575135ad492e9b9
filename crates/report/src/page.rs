//! Frame of a page: one HTML file without network or script, light and dark, fit to print.

use crate::escape::escape;
use crate::svg;

const STYLE: &str = "\
:root{color-scheme:light dark;--paper:#fff;--panel:#f6f8fa;--ink:#1d2530;--soft:#5d6773;--line:#dfe4e9;\
--a:#2667a8;--b:#c8551b;--good:#2c7a4f}\
@media(prefers-color-scheme:dark){:root{--paper:#14181d;--panel:#1c2229;--ink:#e4e8ec;--soft:#98a2ad;\
--line:#2f363f;--a:#6fb1ee;--b:#f29a63;--good:#62c495}}\
*{box-sizing:border-box}body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 \
system-ui,-apple-system,'Segoe UI',sans-serif}\
main{max-width:1180px;margin:0 auto;padding:2.5rem 1.5rem 4rem}h1{font-size:1.75rem;line-height:1.25;margin:0 0 \
.35rem;font-weight:650}\
h2{font-size:1.15rem;margin:2.6rem 0 .8rem;font-weight:650}p{margin:.4rem 0;max-width:75ch}\
.lead{font-size:1.06rem;color:var(--soft)}\
code{font:0.92em ui-monospace,Menlo,Consolas,monospace;overflow-wrap:anywhere}\
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(140px,1fr));gap:.8rem;margin:1.6rem 0 0}\
.card{background:var(--panel);border:1px solid var(--line);border-radius:10px;padding:.8rem 1rem}\
.card b{display:block;font-size:1.6rem;line-height:1.2;font-weight:650;font-variant-numeric:tabular-nums}.card \
b small{font-size:.95rem;font-weight:500}\
.card span{color:var(--soft);font-size:.86rem}\
dl{display:grid;grid-template-columns:max-content 1fr;gap:.2rem 1.2rem;margin:0}dt{color:var(--soft)}\
dd{margin:0;overflow-wrap:anywhere}\
.pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(300px,1fr));gap:1.2rem}\
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(420px,1fr));gap:1.2rem}\
figure{margin:0;break-inside:avoid}figure img{display:block;width:100%;height:auto;border:1px solid var(--line);\
border-radius:6px;image-rendering:auto}\
figure svg.chart{display:block;width:100%;height:auto}figcaption{color:var(--soft);font-size:.88rem;margin-top:.4rem}\
.scale{display:block;width:100%;height:34px;margin-top:.5rem}.scale text{font:11px system-ui,sans-serif;\
fill:var(--soft)}\
.key{display:inline-block;width:.8em;height:.8em;border-radius:2px;margin-right:.3em;border:1px solid var(--line)}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.92rem;\
min-width:min(100%,420px)}\
th,td{text-align:right;padding:.28rem .8rem;border-bottom:1px solid var(--line);white-space:nowrap}\
th:first-child{text-align:left;font-weight:500}\
.words{text-align:left;white-space:normal}\
thead th{color:var(--soft);font-weight:600;border-bottom:2px solid var(--line)}tbody tr:hover{background:var(--panel)}\
.notes{background:var(--panel);border-left:4px solid var(--b);border-radius:0 8px 8px 0;padding:.6rem 1.1rem;\
margin-top:1.4rem}.notes ul{margin:.2rem 0;padding-left:1.1rem}\
.layers{margin:.4rem 0}.layers>input{position:absolute;opacity:0}.layers>label{display:inline-block;margin:0 .4rem \
.5rem 0;padding:.25rem .7rem;border:1px solid var(--line);border-radius:999px;cursor:pointer;font-size:.9rem;\
background:var(--panel)}\
.layers>input:checked+label{background:var(--a);color:var(--paper);border-color:var(--a)}\
#hatched:focus-visible+label{outline:2px solid var(--b)}.stack{max-width:1000px}\
.stack figure{display:none}.stack figure img{image-rendering:pixelated}\
.map{position:relative}.hatching{position:absolute;inset:1px;background-size:100% 100%;pointer-events:none;\
image-rendering:pixelated}#hatched:not(:checked)~.stack .hatching{display:none}\
a{color:var(--a);text-underline-offset:.15em}.files{columns:20rem;list-style:none;margin:0;padding:0}\
.files li{break-inside:avoid;padding:.1rem 0}.files span{color:var(--soft);font-size:.88rem}\
.links{display:flex;flex-wrap:wrap;gap:.05rem .6rem;font-weight:400;min-width:13rem}\
thead th{white-space:normal;vertical-align:bottom}\
.thumb{display:block;min-width:96px;max-width:128px;max-height:96px;border:1px solid var(--line);border-radius:4px}\
.good{color:var(--good)}.bad{color:var(--b);font-weight:600}.key,.ramp,.hatching,.card{print-color-adjust:exact;\
-webkit-print-color-adjust:exact}\
.legend{display:flex;flex-wrap:wrap;gap:.3rem .9rem;align-items:center;margin-top:.5rem;font-size:.86rem;\
color:var(--soft)}\
.ramp{flex:1;min-width:120px;max-width:420px;height:12px;border-radius:3px}\
footer{margin-top:3rem;color:var(--soft);font-size:.88rem;border-top:1px solid var(--line);padding-top:.8rem}\
@media(max-width:520px){.plots{grid-template-columns:1fr}dl{grid-template-columns:1fr}}\
@page{size:A4;margin:14mm 13mm}\
@media print{:root{color-scheme:light;--paper:#fff;--panel:#f6f8fa;--ink:#000;--soft:#444;--line:#bbb;--a:#1d5a96;\
--b:#b0460f;--good:#1d6b42}body{font-size:10pt;line-height:1.4}main{max-width:none;padding:0}\
h1{font-size:17pt}h2{font-size:12pt;margin:1.2rem 0 .5rem;break-after:avoid}.lead{font-size:10.5pt}\
p{max-width:none;orphans:3;widows:3}.cards{grid-template-columns:repeat(5,1fr);gap:.4rem;margin-top:.8rem}\
.card{padding:.4rem .6rem;break-inside:avoid}.card b{font-size:13pt}.card b small{font-size:8.5pt}\
.card span,figcaption,.legend,.files span{font-size:8.5pt}\
.layers>input,.layers>label{display:none}.stack{max-width:none;display:grid;grid-template-columns:1fr 1fr;gap:.9rem}\
.stack figure{display:block!important}.stack figure:first-child{grid-column:1/-1}\
.stack figure img{max-height:150mm;object-fit:contain;width:auto;max-width:100%}.map{width:fit-content}\
.pictures{grid-template-columns:repeat(3,1fr)}.plots{grid-template-columns:1fr 1fr;gap:.7rem}\
.notes{break-inside:avoid}.files{columns:2}a{color:inherit;text-decoration:none}\
.wide{overflow:visible}table{font-size:8pt;min-width:0;width:100%}thead{display:table-header-group}\
tr{break-inside:avoid}th,td{padding:.12rem .3rem;white-space:normal}th:first-child{overflow-wrap:break-word}\
dl{font-size:9pt}.links{min-width:0}.thumb{min-width:0;max-width:72px}footer{margin-top:1.2rem}}";

/// Returns a whole page around a body of HTML. The title is plain text.
pub(crate) fn page(title: &str, body: &str) -> String {
    let (title, version) = (escape(title), env!("CARGO_PKG_VERSION"));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src \
         'unsafe-inline'\">\n\
         <meta name=\"generator\" content=\"skysweep {version}\">\n\
         <title>{title}</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>{STYLE}{}</style>\n</head>\n\
         <body>\n<main>\n{body}\n<footer>skysweep {version}. One file: nothing is fetched, nothing \
         runs.</footer>\n</main>\n</body>\n</html>\n",
        svg::STYLE
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_can_leave_its_place() {
        assert_eq!(escape("<b a='\"'>&\u{7}"), "&lt;b a=&#39;&quot;&#39;&gt;&amp;\u{fffd}");
        let page = page("</title><script>", "<p>body</p>");
        assert!(!page.contains("<script") && page.contains("<p>body</p>"));
        assert!(!page.contains("http://") && !page.contains("https://"));
    }
}
