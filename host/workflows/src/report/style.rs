pub const STYLE: &str = "\
:root{color-scheme:light}\
body{margin:0;background:#fff;color:#1b2126;font:15px/1.5 system-ui,sans-serif}\
main{max-width:1080px;margin:0 auto;padding:32px 24px}\
header{border-bottom:2px solid #1b2126;margin-bottom:24px}\
h1{font-size:26px;margin:0}h2{font-size:17px;margin:28px 0 10px}p{margin:4px 0 12px;color:#4a545c}\
.row{display:flex;flex-wrap:wrap;gap:16px}figure{margin:0;flex:1 1 300px;min-width:0;max-width:520px}\
img{width:100%;height:auto;border:1px solid #d5dade;image-rendering:auto}\
figcaption{font-size:13px;color:#4a545c;margin-top:4px}\
.plot{margin-top:16px;max-width:none}svg{width:100%;height:auto}\
table{border-collapse:collapse;margin:16px 0;font-variant-numeric:tabular-nums}\
th{text-align:left;font-weight:500;padding:4px 24px 4px 0}td{text-align:right;padding:4px 0}tr{border-bottom:1px solid #e4e8eb}\
pre{background:#f4f6f7;border:1px solid #e4e8eb;padding:12px;overflow-x:auto;font-size:12px;line-height:1.4}\
.note{background:#fbf6e6;border-left:3px solid #b98900;padding:8px 12px;white-space:pre-wrap}\
footer{margin-top:32px;color:#4a545c;font-size:13px}\
@media print{main{padding:0;max-width:none}figure{break-inside:avoid;flex:1 1 45%}pre{white-space:pre-wrap}}";
