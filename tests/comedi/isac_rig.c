// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * isac_rig: a rig that exists only in the kernel, for tests under QEMU. Not part of the toolkit: the kernel's Comedi symbols are for
 * GPL modules, so this file is under the GPL and stands alone.
 *
 * Every attached card is a view of the same six joints, so that sensors and valves may hang on cards of their own:
 *   subdevice 0   8 inputs, 12 bit, 0..10 V: 0 and 2 the forces at rest, 4 and 6 the pressures of joint 0, with a lag
 *   subdevice 1   12 outputs, 12 bit, 4..20 mA: two valves a joint
 *   subdevice 2   6 counters, 24 bit: each joint follows the difference of its two valves, with a lag
 *   subdevice 3   1 digital output: the heartbeat; the parameter `beats` counts its edges
 * Lags are whole-number filters per reading, so that a run under virtual time is the same every time.
 *
 * Faults, as module parameters that can be set while it runs (they act on readings of inputs; enc_jump on counters):
 *   fail_read   errno to answer with      stall_ms   how long a reading holds the card
 *   empty       read 65535, as an empty slot does     enc_jump   counts to add once
 */
#include <linux/comedi/comedidev.h>
#include <linux/delay.h>
#include <linux/module.h>

#define JOINTS 6
#define INPUTS 8
#define OUTPUTS (2 * JOINTS)
#define FORCE_AT_REST 2151 /* 95 N: 205 + 95 / (200 / 4096) */

static int fail_read;
module_param(fail_read, int, 0644);
static int stall_ms;
module_param(stall_ms, int, 0644);
static int empty;
module_param(empty, int, 0644);
static int enc_jump;
module_param(enc_jump, int, 0644);
static int beats;
module_param(beats, int, 0644);

/* The one rig, whichever card looks at it. Fixed point: 256 to a count. */
static int position[JOINTS];
static int pressure[2];
static unsigned int output[OUTPUTS];

static const struct comedi_lrange input_range = { 1, { UNI_RANGE(10) } };
static const struct comedi_lrange output_range = { 1, { RANGE_mA(4, 20) } };

static unsigned int input_code(unsigned int channel)
{
	unsigned int muscle;

	if (channel == 0 || channel == 2)
		return FORCE_AT_REST;
	if (channel != 4 && channel != 6)
		return 0;
	muscle = channel == 6;
	/* 0..4095 is 0..5 kg/cm2 at the valve, 0..4095 is 0..10 kg/cm2 at the sensor */
	pressure[muscle] += ((int)output[muscle] * 128 - pressure[muscle]) >> 6;
	return pressure[muscle] >> 8;
}

static int rig_read_input(struct comedi_device *dev, struct comedi_subdevice *s, struct comedi_insn *insn,
			  unsigned int *data)
{
	unsigned int i;

	if (stall_ms)
		msleep(stall_ms);
	if (fail_read)
		return -fail_read;
	for (i = 0; i < insn->n; i++)
		data[i] = empty ? 65535 : input_code(CR_CHAN(insn->chanspec));
	return insn->n;
}

static int rig_write_output(struct comedi_device *dev, struct comedi_subdevice *s, struct comedi_insn *insn,
			    unsigned int *data)
{
	unsigned int channel = CR_CHAN(insn->chanspec);

	if (insn->n)
		output[channel] = data[insn->n - 1];
	return insn->n;
}

static int rig_read_output(struct comedi_device *dev, struct comedi_subdevice *s, struct comedi_insn *insn,
			   unsigned int *data)
{
	unsigned int i;

	for (i = 0; i < insn->n; i++)
		data[i] = output[CR_CHAN(insn->chanspec)];
	return insn->n;
}

static int rig_read_counter(struct comedi_device *dev, struct comedi_subdevice *s, struct comedi_insn *insn,
			    unsigned int *data)
{
	unsigned int channel = CR_CHAN(insn->chanspec), i;
	int wanted;

	for (i = 0; i < insn->n; i++) {
		/* a quarter of the valves' difference, in counts */
		wanted = ((int)output[2 * channel + 1] - (int)output[2 * channel]) * 64;
		position[channel] += (wanted - position[channel]) >> 7;
		position[channel] += enc_jump * 256;
		enc_jump = 0;
		data[i] = (unsigned int)(position[channel] >> 8) & s->maxdata;
	}
	return insn->n;
}

static int rig_heartbeat(struct comedi_device *dev, struct comedi_subdevice *s, struct comedi_insn *insn,
			 unsigned int *data)
{
	unsigned int before = s->state;

	comedi_dio_update_state(s, data);
	beats += s->state != before;
	data[1] = s->state;
	return insn->n;
}

static int rig_attach(struct comedi_device *dev, struct comedi_devconfig *it)
{
	struct comedi_subdevice *s;
	int ret = comedi_alloc_subdevices(dev, 4);

	if (ret)
		return ret;
	s = &dev->subdevices[0];
	s->type = COMEDI_SUBD_AI;
	s->subdev_flags = SDF_READABLE | SDF_GROUND;
	s->n_chan = INPUTS;
	s->maxdata = 4095;
	s->range_table = &input_range;
	s->insn_read = rig_read_input;
	s = &dev->subdevices[1];
	s->type = COMEDI_SUBD_AO;
	s->subdev_flags = SDF_WRITABLE | SDF_READABLE;
	s->n_chan = OUTPUTS;
	s->maxdata = 4095;
	s->range_table = &output_range;
	s->insn_write = rig_write_output;
	s->insn_read = rig_read_output;
	s = &dev->subdevices[2];
	s->type = COMEDI_SUBD_COUNTER;
	s->subdev_flags = SDF_READABLE | SDF_LSAMPL;
	s->n_chan = JOINTS;
	s->maxdata = 0xffffff;
	s->range_table = &range_unknown;
	s->insn_read = rig_read_counter;
	s = &dev->subdevices[3];
	s->type = COMEDI_SUBD_DO;
	s->subdev_flags = SDF_WRITABLE;
	s->n_chan = 1;
	s->maxdata = 1;
	s->range_table = &range_digital;
	s->insn_bits = rig_heartbeat;
	return 0;
}

static void rig_detach(struct comedi_device *dev)
{
}

static struct comedi_driver rig_driver = {
	.driver_name = "isac_rig",
	.module = THIS_MODULE,
	.attach = rig_attach,
	.detach = rig_detach,
};
module_comedi_driver(rig_driver);

MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("A rig of six joints that exists only in the kernel");
