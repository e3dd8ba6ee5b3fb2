#!/bin/sh
# Fetches Debian's kernel and its headers into a folder and builds isac_rig.ko there. Prints what is missing and exits 77 where
# that cannot be done. Nothing is installed.
#   prepare.sh FOLDER SOURCE
set -u
folder=$1; source=$2
skip() { echo "SKIPPED: $*"; exit 77; }
for tool in apt-get apt-cache dpkg-deb cc make; do
  command -v $tool >/dev/null 2>&1 || skip "$tool is missing (a Debian machine with a compiler is needed)"
done
mkdir -p "$folder" && cd "$folder" || exit 1
if [ ! -f ready ]; then
  image=$(apt-cache depends linux-image-amd64 2>/dev/null | awk '/Depends:/{print $2; exit}')
  [ -n "$image" ] || skip "apt knows no package linux-image-amd64 (run apt-get update)"
  version=${image#linux-image-}
  more=$(apt-cache depends "linux-headers-$version" 2>/dev/null | awk '/Depends:/{print $2}' | grep -E -- '-common$|^linux-kbuild')
  for package in "$image" "linux-headers-$version" $more; do
    ls "$package"_*.deb >/dev/null 2>&1 || apt-get -q download "$package" >/dev/null 2>&1 || skip "$package cannot be fetched from Debian"
  done
  dpkg-deb --fsys-tarfile "$image"_*.deb | tar x ./boot ./lib/modules/"$version"/kernel/drivers/comedi || exit 1
  for package in linux-headers-*.deb linux-kbuild-*.deb; do dpkg-deb -x "$package" . || exit 1; done
  # The headers name their own place and their compiler; here they lie elsewhere.
  sed -i "s|/usr/src/|$PWD/usr/src/|g" usr/src/linux-headers-"$version"/Makefile
  echo "$version" > version
fi
version=$(cat version)
mkdir -p module && cp "$source/isac_rig.c" module/ && echo 'obj-m += isac_rig.o' > module/Makefile
make -s -C usr/src/linux-headers-"$version" M="$PWD/module" CC="${KERNEL_CC:-cc}" modules > module.log 2>&1 ||
  { tail -n 5 module.log; skip "isac_rig.ko cannot be built against linux-headers-$version with this compiler"; }
touch ready
