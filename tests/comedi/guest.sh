#!/bin/sh
# Boots Debian's kernel in QEMU with one program and the drivers it needs, and passes or fails by the program's last line.
# Time in the guest is virtual (-icount): a busy host changes nothing of what is measured. 77: something is missing, and is named.
#   guest.sh FOLDER SOURCE PROGRAM
set -u
folder=$1; source=$2; program=$3
skip() { echo "SKIPPED: $*"; exit 77; }
for tool in qemu-system-x86_64 cpio gzip ldd; do
  command -v $tool >/dev/null 2>&1 || skip "$tool is missing (apt-get install qemu-system-x86 cpio)"
done
busybox=$(command -v busybox) && ! ldd "$busybox" >/dev/null 2>&1 || skip "a static busybox is missing (apt-get install busybox-static)"
sh "$source/prepare.sh" "$folder" "$source" || exit $?
cd "$folder" || exit 1
version=$(cat version)
root=root.$$
trap 'rm -rf "$folder/$root" "$folder/initrd.$$"' EXIT
rm -rf "$root"; mkdir -p $root/bin $root/modules $root/tmp
cp "$busybox" $root/bin/busybox; cp "$program" $root/bin/guest
cp "$source/../../data/cards/soft_arm.toml" "$source/../../data/arms/right_soft_arm.toml" $root/
ldd "$program" | awk '{for (i = 1; i <= NF; i++) if ($i ~ /^\//) print $i}' | while read -r library; do
  mkdir -p "$root$(dirname "$library")"; cp -L "$library" "$root$library"
done
drivers=lib/modules/$version/kernel/drivers/comedi
cp $drivers/comedi.ko $drivers/drivers/comedi_test.ko module/isac_rig.ko $root/modules/
cat > $root/init <<'I'
#!/bin/busybox sh
/bin/busybox mkdir -p /proc /sys /dev
/bin/busybox mount -t proc none /proc
/bin/busybox mount -t sysfs none /sys
/bin/busybox mount -t devtmpfs none /dev
/bin/busybox insmod /modules/comedi.ko comedi_num_legacy_minors=2
/bin/busybox insmod /modules/comedi_test.ko
/bin/busybox insmod /modules/isac_rig.ko
/bin/busybox echo; /bin/guest
/bin/busybox poweroff -f
I
chmod +x $root/init
(cd $root && find . | cpio -o -H newc --quiet) | gzip -1 > initrd.$$
timeout "${GUEST_SECONDS:-280}" qemu-system-x86_64 -accel tcg -icount shift=1,sleep=off -m 512 -nodefaults -nographic -no-reboot \
  -serial stdio -kernel boot/vmlinuz-"$version" -initrd initrd.$$ -append "console=ttyS0 quiet panic=-1 preempt=full" |
  tr -d '\r' | grep -aE '^(ok|FAIL|note|RESULT)' | tee output.txt
grep -q '^RESULT PASS' output.txt
