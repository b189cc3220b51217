#!/bin/sh
# Compresses the files of a list on this machine with GNU parallel, one file on each core, without a service.
#
#   find scans -type f >list.txt
#   parallel.sh list.txt materials [OPTION of wavelume compress]…
#
# writes materials/NAME.wlm for each file. Start it again after a kill or a failure: it leaves out the files whose
# material is there, and a material appears whole or not at all. To do one anew, delete its material. Files are known by
# their last name, so no two paths of the list may end alike. JOBS is the number of files at a time (default: one on
# each core).
#
# Exit code 0: every file has its material. 1: some have none; stderr has the reason behind the path. 2: nothing was
# begun. materials/log.tsv has a line with times and exit code for each file of the last start. It needs GNU parallel
# (Debian: apt install parallel) and wavelume, or the program that WAVELUME names.
set -u
[ $# -ge 2 ] || { sed -n '2,/^set/{/^set/!s/^# \{0,1\}//p}' "$0" >&2; exit 2; }
list=$1 out=$2
shift 2
twice=$(sed 's|.*/||' "$list" | sort | uniq -d | head -n 1)
[ -z "$twice" ] || { echo "$list: two paths end in $twice; give them different names or output directories" >&2; exit 2; }
{ [ -r "$list" ] && mkdir -p "$out" && command -v parallel && command -v "${WAVELUME:=wavelume}"; } >/dev/null ||
  { echo "needed: a readable $list, a directory $out, parallel, and $WAVELUME in the PATH" >&2; exit 2; }

while IFS= read -r file || [ -n "$file" ]; do
  [ -s "$out/${file##*/}.wlm" ] || printf '%s\0' "$file"
done <"$list" | parallel --null --no-run-if-empty --quote --jobs "${JOBS:-100%}" --joblog "$out/log.tsv" --tag \
  "$WAVELUME" compress --threads 1 "$@" -o "$out/{/}.wlm" -- '{}' >/dev/null
failures=$?
made=$(awk -F '\t' 'NR > 1 && $7 == 0' "$out/log.tsv" 2>/dev/null | wc -l)
echo "$((made)) compressed, $((failures)) failed"
[ "$failures" -eq 0 ] || exit 1
